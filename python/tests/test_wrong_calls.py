"""Wrong calls end with ``anyhit.Error``, ``TypeError`` or ``ValueError``, and never with a crash."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import anyhit
import odd_arguments
import pytest


def test_every_public_callable_survives_odd_arguments() -> None:
    assert len(odd_arguments.odd_arguments()) > 800
    script = Path(__file__).with_name("wrong_calls.py")
    # A process of its own: a crash would take the tests with it.
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=900)
    last = done.stderr[-3000:]
    assert done.returncode == 0, f"crashed in the last of these:\n{last}"
    found = re.search(r"(\d+) calls of (\d+) callables, (\d+) odd arguments, (\d+) wrong, few: (.*)", done.stdout)
    assert found, done.stdout
    calls, callables, _, wrong, few = found.groups()
    assert wrong == "0", done.stdout
    assert few == "[]" and int(callables) > 100 and int(calls) > 1000 * int(callables) / 2


def test_lists_that_take_little_memory_themselves_are_not_read_whole() -> None:
    thousand: Any = [1] * 1000
    endless: Any
    for endless in (range(10**12), [[thousand] * 1000] * 1000):
        with pytest.raises(anyhit.InvalidArgument, match="use an array of numpy"):
            anyhit.Ray(endless, [0, 0, 1])
    with pytest.raises(anyhit.InvalidArgument, match="hit_records: more than 1048576 elements"):
        anyhit.Pipeline(hit_records=itertools.repeat(None))
