"""The plugin for pytest, run on projects of its own."""

from __future__ import annotations

import importlib.util

import pytest
from conftest import REPOSITORY

SHADER = """
enable wgpu_ray_tracing_pipeline;

struct Payload { t: f32, hits: u32 }

var<incoming_ray_payload> payload: Payload;

@closest_hit @incoming_payload(payload)
fn shade(@builtin(ray_t_current_max) t: f32) {
    payload.t = t;
    payload.hits += 1u;
}
"""

# A ball of radius 1/2, whose nearest point is 3.5 away.
RAYS = """
version = 1

[shaders]
ball = "ball.wgsl"

[pipeline]
hit = [{ closest_hit = "ball:shade" }]

[geometry.ball]
type = "spheres"
positions = [[0, 0, 0]]
radii = 0.5

[[instance]]
geometry = "ball"

[[ray]]
name = "the centre"
origin = [0, 0, 4]
direction = [0, 0, -1]
expect = { t = 3.5, payload = { t = 3.5, hits = 1 }, because = "4 - 1/2" }

[[ray]]
name = "beside it"
origin = [1, 0, 4]
direction = [0, 0, -1]
expect = { miss = true }
"""


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    folder = pytester.mkdir("cases")
    (folder / "ball.wgsl").write_text(SHADER)
    (folder / "ball.test.toml").write_text(RAYS)
    return pytester


def test_each_ray_is_an_item(project: pytest.Pytester) -> None:
    result = project.runpytest_inprocess("-v")
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(
        ["cases/ball.test.toml::the centre PASSED*", "cases/ball.test.toml::beside it PASSED*"]
    )
    project.runpytest_inprocess("-k", "centre").assert_outcomes(passed=1, deselected=1)


def test_a_failure_prints_the_place_and_the_ray(project: pytest.Pytester) -> None:
    file = project.path / "cases/ball.test.toml"
    file.write_text(file.read_text().replace("payload = { t = 3.5", "payload = { t = 3.25"))
    result = project.runpytest_inprocess()
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        [
            "*payload.t: expected 3.25 (*), found 3.5 (*",
            "*cases/ball.test.toml:22:*",
            "*the ray, explained:",
            "FAILED cases/ball.test.toml::the centre*",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    plain = project.runpytest_inprocess("--anyhit-no-explanation")
    plain.stdout.no_fnmatch_line("*the ray, explained:")


def test_a_file_with_a_mistake_is_an_error_with_its_place(project: pytest.Pytester) -> None:
    file = project.path / "cases/ball.test.toml"
    file.write_text(file.read_text().replace('type = "spheres"', 'type = "sphere"'))
    result = project.runpytest_inprocess()
    assert result.ret != 0
    result.stdout.fnmatch_lines(["*cases/ball.test.toml:11:*"])


@pytest.mark.parametrize(
    ("case", "option"),
    [
        ("sanitize/pow-domain", ["--anyhit-sanitize"]),
        ("many-seeds/anyhit-order", ["--anyhit-many-seeds", "8"]),
    ],
)
def test_options_judge_what_passes(pytester: pytest.Pytester, case: str, option: list[str]) -> None:
    folder = str(REPOSITORY / "shaders" / case)
    arguments = ["--rootdir", str(REPOSITORY), "-p", "no:cacheprovider", folder]
    pytester.runpytest_inprocess(*arguments).assert_outcomes(passed=1)
    pytester.runpytest_inprocess(*arguments, *option).assert_outcomes(failed=1)


def test_cases_of_the_repository_pass_on_two_workers(pytester: pytest.Pytester) -> None:
    if importlib.util.find_spec("xdist") is None:
        pytest.skip("SKIPPED: test_cases_of_the_repository_pass_on_two_workers: pytest-xdist is not installed")
    cases = [REPOSITORY / "shaders/pass" / name for name in ("sphere", "lss", "testing", "payload")]
    alone = pytester.runpytest_subprocess("--rootdir", REPOSITORY, "-p", "no:cacheprovider", *cases)
    assert alone.ret == 0
    shared = pytester.runpytest_subprocess(
        "--rootdir", REPOSITORY, "-p", "no:cacheprovider", "-n", "2", *cases
    )
    assert shared.ret == 0
    assert shared.parseoutcomes()["passed"] == alone.parseoutcomes()["passed"] > 10


def test_the_summary_has_the_reason(project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    file = project.path / "cases/ball.test.toml"
    file.write_text(file.read_text().replace("payload = { t = 3.5, hits = 1", "payload = { t = 3.25, hits = 2"))
    result = project.runpytest_inprocess()
    reason = "payload.t: expected 3.25, found 3.5, *"
    summary = "FAILED cases/ball.test.toml::the centre - " + reason
    result.stdout.fnmatch_lines([summary, "*1 failed, 1 passed*"])
    # The hint is a call of Python.
    result.stdout.fnmatch_lines(['*see also: anyhit.Scene.open("*ball.test.toml").explain("the centre")'])
    lines = project.runpytest_inprocess("--tb=line")
    lines.stdout.fnmatch_lines(["cases/ball.test.toml:22: " + reason + "(and 1 more)"])
    if importlib.util.find_spec("xdist") is not None:
        shared = project.runpytest_subprocess("-n", "2", "-p", "no:cacheprovider")
        shared.stdout.fnmatch_lines([summary, "*1 failed, 1 passed*"])


def test_cases_have_a_marker_and_an_empty_file_a_note(project: pytest.Pytester) -> None:
    project.runpytest_inprocess("-m", "anyhit", "--strict-markers").assert_outcomes(passed=2)
    project.runpytest_inprocess("-m", "not anyhit").assert_outcomes(deselected=2)
    file = project.path / "cases/empty.test.toml"
    rays = (project.path / "cases/ball.test.toml").read_text().partition("[[ray]]")[0]
    file.write_text(rays)
    result = project.runpytest_inprocess()
    result.stdout.fnmatch_lines(["*PytestCollectionWarning: empty.test.toml has no test: *"])
    assert result.parseoutcomes()["passed"] == 2


UNIT_TEST = """
import anyhit
from pathlib import Path

def test_a_number_is_clamped():
    module = anyhit.Module.open(Path(__file__).with_name("clamp.wgsl"))
    found = anyhit.ComputeTest(module).run(outputs={"number": [7]})
    assert found["number"].tolist() == [3]
"""
CLAMP = """@group(0) @binding(0) var<storage, read_write> number: array<u32>;

@compute @workgroup_size(1)
fn main() {
    if (number[0] > 3u) {
        number[0] = 3u;
    } else {
        number[0] = 0u;
    }
}
"""


def test_coverage_of_shaders_is_written(project: pytest.Pytester) -> None:
    (project.path / "cases/clamp.wgsl").write_text(CLAMP)
    (project.path / "cases/test_clamp.py").write_text(UNIT_TEST.replace("[7]", "__import__('numpy').full(1, 7, 'u4')"))
    result = project.runpytest_subprocess("--anyhit-coverage", "out.lcov", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=3)
    result.stdout.fnmatch_lines(["*coverage of shaders*", "*lines *", "written to out.lcov"])
    alone = (project.path / "out.lcov").read_text()
    files = {record.split("SF:")[1].split("\n")[0]: record for record in alone.split("end_of_record") if "SF:" in record}
    ball = next(record for name, record in files.items() if name.endswith("ball.wgsl"))
    # Line 10 of the shader runs once for the one ray that hits.
    assert "DA:10,1" in ball and "DA:11,1" in ball
    clamp = next(record for name, record in files.items() if name.endswith("clamp.wgsl"))
    # 7 is greater than 3: one branch is taken, the other one is not.
    assert "DA:6,1" in clamp and "DA:8,0" in clamp
    if importlib.util.find_spec("xdist") is not None:
        project.runpytest_subprocess("--anyhit-coverage", "two.lcov", "-n", "2", "-p", "no:cacheprovider")
        assert (project.path / "two.lcov").read_text() == alone
    project.runpytest_subprocess("--anyhit-coverage", "out.xml", "-p", "no:cacheprovider")
    assert "<coverage" in (project.path / "out.xml").read_text()


def test_coverages_add_up() -> None:
    import pickle

    import anyhit

    suite = anyhit.Suite(REPOSITORY / "shaders/pass/sphere/closest-hit/scene.toml")
    one = suite.run(0, coverage=True).coverage
    assert one is not None and suite.run(0).coverage is None
    both = one + one
    for name, lines in one.lines.items():
        assert both.lines[name] == {line: 2 * count for line, count in lines.items()}
    assert pickle.loads(pickle.dumps(one)) == one == one + anyhit.Coverage() != both
    with pytest.raises(anyhit.InvalidArgument, match="json"):
        anyhit.Coverage("{")


def test_a_test_that_a_suite_lacks_is_an_error() -> None:
    import anyhit

    suite = anyhit.Suite(REPOSITORY / "shaders/pass/sphere/closest-hit/scene.toml")
    with pytest.raises(anyhit.InvalidArgument, match=f"at: no test 9: the suite has {len(suite.names)}"):
        suite.run(9)


class CountedLines:
    """A coverage in which an addition costs its lines."""

    cost = 0

    def __init__(self, lines: int) -> None:
        self.lines = lines

    def __add__(self, other: CountedLines) -> CountedLines:
        CountedLines.cost += self.lines + other.lines
        return CountedLines(self.lines + other.lines)


def test_the_sum_of_coverages_takes_no_quadratic_time() -> None:
    from anyhit.pytest_plugin import _CoverageSum

    reports = _CoverageSum()
    for _ in range(4096):
        reports.add(CountedLines(1))  # type: ignore[arg-type]
    # One after the other they would cost 4096 * 4097 / 2 lines.
    assert CountedLines.cost <= 4096 * 12


def test_a_sum_of_coverages_is_that_of_all() -> None:
    import anyhit
    from anyhit.pytest_plugin import _CoverageSum

    suite = anyhit.Suite(REPOSITORY / "shaders/pass/sphere/closest-hit/scene.toml")
    one = suite.run(0, coverage=True).coverage
    assert one is not None
    reports, wanted = _CoverageSum(), anyhit.Coverage()
    for _ in range(7):
        assert reports.total() == wanted
        reports.add(one)
        wanted += one
    assert reports.total() == wanted
