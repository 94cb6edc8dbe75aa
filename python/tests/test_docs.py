"""The code of docs/python.md and of python/README.md, run in the order in which it stands there."""

from __future__ import annotations

import importlib.util
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np  # noqa: F401 (loads once per process, and pytester forgets what its runs load)
import pytest
from conftest import FIXTURES, REPOSITORY

PAGES = ["docs/python.md", "python/README.md"]
FENCE = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A block of code: its language, what stands behind it, its text, and its first line."""

    language: str
    words: dict[str, str]
    text: str
    line: int


def blocks(page: str) -> Iterator[Block]:
    text = (REPOSITORY / page).read_text("utf-8")
    for found in FENCE.finditer(text):
        words = dict(word.split("=") for word in found[2].split())
        yield Block(found[1], words, found[3], text.count("\n", 0, found.start()) + 2)


def is_there(what: str) -> bool:
    return shutil.which(what) is not None or importlib.util.find_spec(what) is not None


@pytest.mark.parametrize("page", PAGES)
def test_the_code_of_a_page_runs(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pytester: pytest.Pytester
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"FIXTURES": FIXTURES, "SHADERS": REPOSITORY / "shaders"}
    ran, lacking = 0, []
    for block in blocks(page):
        if "file" in block.words:
            (tmp_path / block.words["file"]).write_text(block.text)
        elif block.language == "sh":
            # `.ci/judge-python` runs the commands that install, `test_ray.py` those of the examples.
            elsewhere = ("pip install ", "maturin build ", "python examples/scale/")
            assert all(line == "pytest" or line.startswith(elsewhere) for line in block.text.splitlines())
        elif block.language == "python":
            needs = block.words.get("needs", "").split(",")
            absent = [tool for tool in needs if tool and not is_there(tool)]
            if absent:
                lacking.append(f"{page}:{block.line}: {', '.join(absent)}: not installed")
                continue
            # Compiled with its place, so that a failure shows the line of the page.
            exec(compile("\n" * (block.line - 1) + block.text, REPOSITORY / page, "exec"), names)
            ran += 1
    assert ran + len(lacking) > 0
    tests = list(tmp_path.glob("test_*.py"))
    if tests:
        pytester.runpytest_inprocess("-p", "no:cacheprovider", *tests).assert_outcomes(passed=len(tests))
    if lacking:
        pytest.skip("SKIPPED: " + "; ".join(lacking))
