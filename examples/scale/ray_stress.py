"""Judges stress cases on a cluster of Ray: ranges of one seed, whose counts add up.

    python ray_stress.py --seed 1 --cases 100000 --share 2000

Case n of a seed is the same on every machine. A share whose worker is lost runs again elsewhere, so
the sums are those of one machine, whatever happens meanwhile.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import reduce
from typing import Any

import anyhit
import ray

Report = dict[str, Any]

# How often a share may lose its worker.
RETRIES = 5


@ray.remote(max_retries=RETRIES)
def judge(seed: int, first: int, end: int) -> Report:
    """The cases from `first` to `end`, not included."""
    return anyhit.stress(seed, first, end)


def merge(one: Report, other: Report) -> Report:
    """The report of both ranges together: numbers add up, failures follow each other."""
    return {name: value + other[name] for name, value in one.items()}


def shares(count: int, size: int) -> Iterator[tuple[int, int]]:
    """The ranges of so many elements each that make up all."""
    return ((first, min(first + size, count)) for first in range(0, count, size))


def run(seed: int, cases: int, share: int) -> Report:
    """The report of all cases, in the order of their numbers."""
    tasks = [judge.remote(seed, first, end) for first, end in shares(cases, share)]
    return reduce(merge, ray.get(tasks))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--share", type=int, default=2_000, help="cases of one task")
    arguments = parser.parse_args()
    ray.init()
    report = run(arguments.seed, arguments.cases, arguments.share)
    failures = report.pop("failures")
    print(", ".join(f"{count} {name}" for name, count in report.items()))
    for failure in failures:
        print(f"case {failure['number']} of seed {arguments.seed}, {failure['family']}: {failure['what']}")
    print(f"{len(failures)} wrong answers")
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
