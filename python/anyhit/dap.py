"""The debug adapter for editors: ``python -m anyhit.dap``.

An editor starts it and speaks the Debug Adapter Protocol with it over standard input and output. With
``--port N`` it serves one editor after the other on a local port; 0 selects a free one. A launch
configuration names a scene file and a pixel, a ray or an invocation, as that of ``anyhit dap`` does.
"""

from __future__ import annotations

import argparse
import signal
from collections.abc import Sequence
from typing import Optional

from ._anyhit import _serve_editors
from .errors import Error

__all__ = ["main", "serve"]


def serve(port: Optional[int] = None) -> None:
    """Serves one editor on standard input and output, or one after the other on a local port."""
    _serve_editors(port)


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """The command ``python -m anyhit.dap``."""
    parser = argparse.ArgumentParser(prog="python -m anyhit.dap", description="Debug adapter for editors.")
    parser.add_argument("--port", type=int, metavar="N", help="serve on this local port; 0: a free one")
    port = parser.parse_args(arguments).port
    # It waits for the editor outside of Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        serve(port)
    except Error as error:
        parser.exit(1, f"{error}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
