"""The plugin for pytest: ``scene.toml`` and ``*.test.toml`` files are tests, each launch and each
ray that expects something an item. A failure prints what ``anyhit test`` prints.

Items run in any order and in any process: pytest-xdist may share them (``-n``).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Optional, Union

import pytest

if TYPE_CHECKING:
    from . import Suite

_SCENE = "scene.toml"
_RAYS = ".test.toml"


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("anyhit", "shaders that anyhit runs")
    group.addoption(
        "--anyhit-sanitize",
        action="store_true",
        help="run each case that passes under the sanitizer, too; what it denies fails the case",
    )
    group.addoption(
        "--anyhit-many-seeds",
        type=int,
        metavar="N",
        help="run each launch that passes N times more, with other choices where the "
        "specification leaves some; outputs that depend on them fail the case",
    )
    group.addoption(
        "--anyhit-perturb",
        type=int,
        metavar="N",
        help="run each case N times more with float results moved as devices may; outputs that "
        "are not stable fail the case",
    )
    group.addoption(
        "--anyhit-all-widths",
        action="store_true",
        help="run launches at 1, 64 and 128 lanes, whose results must be the same",
    )
    group.addoption(
        "--anyhit-no-explanation",
        action="store_true",
        help="leave out the explanations of rays beneath failures",
    )
    group.addoption(
        "--anyhit-pictures",
        metavar="DIR",
        help="where pictures that differ are saved",
    )


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> Optional[SceneFile]:
    if file_path.name == _SCENE or file_path.name.endswith(_RAYS):
        file: SceneFile = SceneFile.from_parent(parent, path=file_path)
        return file
    return None


class CaseFailed(Exception):
    """A case did not pass; the message is its report."""


class SceneFile(pytest.File):
    """A ``scene.toml`` or a ``*.test.toml``."""

    def collect(self) -> Iterator[CaseItem]:
        from . import Suite

        suite = Suite(_shown(self.path))
        for at, name in enumerate(suite.names):
            yield CaseItem.from_parent(self, name=_item_name(name), suite=suite, at=at)


class CaseItem(pytest.Item):
    """A launch, or a ray that expects something."""

    def __init__(self, *, suite: Suite, at: int, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._suite = suite
        self._at = at

    def runtest(self) -> None:
        option = self.config.getoption
        finished = self._suite.run(
            self._at,
            sanitize=option("--anyhit-sanitize"),
            many_seeds=option("--anyhit-many-seeds"),
            perturb=option("--anyhit-perturb"),
            all_widths=option("--anyhit-all-widths"),
            explanation=not option("--anyhit-no-explanation"),
            pictures=option("--anyhit-pictures"),
        )
        if finished.outcome == "known failure":
            pytest.xfail(finished.text)
        if finished.outcome != "passed":
            raise CaseFailed(finished.text.rstrip())

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *args: Any) -> Any:
        if isinstance(excinfo.value, CaseFailed):
            return str(excinfo.value)
        return super().repr_failure(excinfo, *args)

    def reportinfo(self) -> tuple[Union[os.PathLike[str], str], Optional[int], str]:
        return self.path, None, self.name


def _shown(path: Path) -> Path:
    """The path as reports show it: from the current folder, where it lies beneath it."""
    try:
        return path.relative_to(Path.cwd())
    except ValueError:
        return path


def _item_name(name: str) -> str:
    """The part of a test's name behind its file's: the name of a ray, or ``launch``, with the
    variant in front of it."""
    case, _, ray = name.partition("::")
    variant = case[case.rindex("(") :] if case.endswith(")") and "(" in case else ""
    return " ".join(part for part in (variant, ray or "launch") if part)
