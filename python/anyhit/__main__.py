"""The command ``anyhit`` of the wheel, which does not carry the program: says how to get it."""

from __future__ import annotations

import sys


def main() -> int:
    """Prints where the program comes from."""
    print(
        "anyhit: this package is the Python interface; `cargo install --locked --path .` in a clone of "
        "its repository builds the program anyhit",
        file=sys.stderr,
    )
    return 1


if __name__ == "__main__":
    sys.exit(main())
