"""The plugin for pytest: ``scene.toml`` and ``*.test.toml`` files are tests, each launch and each
ray that expects something an item. A failure prints what ``anyhit test`` prints.

Items run in any order and in any process: pytest-xdist may share them (``-n``).
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Optional, Union

import pytest
from _pytest._code.code import (
    ReprEntryNative,
    ReprExceptionInfo,
    ReprFileLocation,
    ReprTraceback,
)

if TYPE_CHECKING:
    from . import Coverage, Finished, Suite

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
        "--anyhit-coverage",
        metavar="FILE",
        help="write which lines and branches of shaders ran, in scene files and in tests of single "
        "shaders whose source is a file: an lcov tracefile, or Cobertura XML if FILE ends in .xml",
    )
    group.addoption(
        "--anyhit-pictures",
        metavar="DIR",
        help="where pictures that differ are saved",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "anyhit: a launch or a ray of a scene file, run by anyhit")
    _prompt_in(config)
    if config.getoption("--anyhit-coverage"):
        from ._anyhit import _record_coverage

        _record_coverage()
        config.pluginmanager.register(CoverageOfShaders(config), "anyhit-coverage")


def _prompt_in(config: pytest.Config) -> None:
    """Lets the debugger's prompt use the terminal: as pytest's own prompt, it is not captured."""
    from . import prompt

    capture = config.pluginmanager.getplugin("capturemanager")

    @contextlib.contextmanager
    def uncaptured() -> Iterator[None]:
        capture.suspend(in_=True)
        try:
            yield
        finally:
            capture.resume()

    surroundings = [prompt._no_terminal] if hasattr(config, "workerinput") else [uncaptured] if capture else []
    before = list(prompt._surroundings)
    prompt._surroundings.extend(surroundings)

    def put_back() -> None:
        prompt._surroundings[:] = before

    config.add_cleanup(put_back)


class _CoverageSum:
    """A sum of coverages. Each is added to sums of as many only, so that the time grows with their
    number times its logarithm."""

    def __init__(self) -> None:
        self._parts: list[tuple[int, Coverage]] = []

    def add(self, covered: Coverage) -> None:
        count = 1
        while self._parts and self._parts[-1][0] == count:
            covered = self._parts.pop()[1] + covered
            count *= 2
        self._parts.append((count, covered))

    def total(self) -> Coverage:
        from . import Coverage

        total = Coverage()
        for _, part in self._parts:
            total += part
        return total


class CoverageOfShaders:
    """Collects what shaders cover, from the processes of pytest-xdist, too, and writes it."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._sum = _CoverageSum()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        from . import Coverage
        from ._anyhit import _recorded_coverage

        outcome: Any = yield
        covered = _recorded_coverage()
        if isinstance(item, CaseItem):
            covered += item.take_coverage()
        if covered != Coverage():
            outcome.get_result().anyhit_coverage = covered.json()

    def pytest_runtest_logreport(self, report: Any) -> None:
        from . import Coverage

        if hasattr(report, "anyhit_coverage"):
            self._sum.add(Coverage(report.anyhit_coverage))

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        file = self._config.getoption("--anyhit-coverage")
        total = self._sum.total()
        total.write(file)
        terminalreporter.section("coverage of shaders")
        terminalreporter.write(total.summary())
        terminalreporter.write_line(f"written to {file}")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> Optional[SceneFile]:
    if file_path.name == _SCENE or file_path.name.endswith(_RAYS):
        file: SceneFile = SceneFile.from_parent(parent, path=file_path)
        return file
    return None


class CaseFailed(Exception):
    """A case did not pass; the message is its report."""

    def __init__(self, finished: Finished) -> None:
        super().__init__(_in_python(finished.text.rstrip()))
        self.reason = finished.reason
        self.place = finished.place


class SceneFile(pytest.File):
    """A ``scene.toml`` or a ``*.test.toml``."""

    def collect(self) -> Iterator[CaseItem]:
        from . import Suite

        suite = Suite(_shown(self.path))
        if not suite.names:
            self.warn(
                pytest.PytestCollectionWarning(
                    f"{self.path.name} has no test: no launch and no ray of it expects anything"
                )
            )
        for at, name in enumerate(suite.names):
            yield CaseItem.from_parent(self, name=_item_name(name), suite=suite, at=at)


class CaseItem(pytest.Item):
    """A launch, or a ray that expects something."""

    def __init__(self, *, suite: Suite, at: int, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._suite = suite
        self._at = at
        self._coverage: Optional[Coverage] = None
        self.add_marker("anyhit")

    def take_coverage(self) -> Coverage:
        """What it covered since the last call."""
        from . import Coverage

        covered, self._coverage = self._coverage, None
        return covered or Coverage()

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
            coverage=option("--anyhit-coverage") is not None,
        )
        self._coverage = finished.coverage
        if finished.outcome == "known failure":
            pytest.xfail(finished.text)
        if finished.outcome != "passed":
            raise CaseFailed(finished)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *args: Any) -> Any:
        failed = excinfo.value
        if isinstance(failed, CaseFailed):
            # The short summary and `--tb=line` show the reason and its place.
            file, line = failed.place or (str(_shown(self.path)), 0)
            crash = ReprFileLocation(file, line, failed.reason)
            entries = [ReprEntryNative([f"{failed}\n"])]
            return ReprExceptionInfo(reprcrash=crash, reprtraceback=ReprTraceback(entries, None, "native"))
        return super().repr_failure(excinfo, *args)

    def reportinfo(self) -> tuple[Union[os.PathLike[str], str], Optional[int], str]:
        return self.path, None, self.name


def _in_python(report: str) -> str:
    """A report whose hint is a call in place of a command."""
    return re.sub(
        r'see also: anyhit trace-one-ray (\S+) --ray ("[^"\\]*")$',
        r'see also: anyhit.Scene.open("\1").explain(\2)',
        report,
    )


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
