"""What the crate has beyond hits and launches: records, motion, hit objects, explanations, flags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import anyhit
import numpy as np
import pytest
from conftest import FIXTURES

PASS = FIXTURES / "pass"
# The unit sphere about the origin: centre and radius, then more that have no extent.
RECORD = {"spheres": [[0, 0, 0, 1], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]}
BALL = """
enable wgpu_ray_tracing_pipeline;
var<incoming_ray_payload> t: f32;
@closest_hit @incoming_payload(t) fn shade(@builtin(ray_t_current_max) at: f32) { t = at; }
@miss @incoming_payload(t) fn sky() { t = -1.0; }
"""


@pytest.fixture(scope="module")
def ball() -> anyhit.Pipeline:
    module = anyhit.Module.from_source("ball.wgsl", BALL)
    return anyhit.Pipeline(hit=[anyhit.Program(module, "shade")], miss=[anyhit.Program(module, "sky")])


def in_box() -> tuple[anyhit.Module, anyhit.Hit]:
    module = anyhit.Module.open(PASS / "intersection/sphere-in-box/main.rint.spv")
    return module, anyhit.Hit.aabb([-1] * 3, [1] * 3, anyhit.Ray([0, 0, 4], [0, 0, -1]))


def test_a_test_decides_on_reports() -> None:
    module, hit = in_box()
    test = anyhit.ShaderTest(module).hit(hit)
    seen: list[dict[str, Any]] = []

    def nearer(report: dict[str, Any]) -> bool:
        seen.append(report)
        return bool(report["t"] < 4)

    # The roots are at 5 and 3.
    described = test.shader_record(RECORD).on_report(nearer).run()
    assert [(one["t"], one["kind"], one["accepted"]) for one in described.reports] == [(5, 6, False), (3, 5, True)]
    assert [one["t"] for one in seen] == [5, 3] and "accepted" not in seen[0]

    def wrong(report: dict[str, Any]) -> bool:
        raise KeyError("a mistake of the callback")

    with pytest.raises(KeyError, match="a mistake of the callback"):
        test.shader_record(RECORD).on_report(wrong).run()


def test_hit_objects_are_found_and_executed() -> None:
    module = anyhit.Module.open(PASS / "hit-object/trace-and-execute/main.rgen.spv")
    triangle = anyhit.Instance.triangles([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]).sbt_offset(3)
    records: list[int] = []

    def trace(call: anyhit.TraceCall) -> Any:
        assert call.into_hit_object
        call.hit(triangle)
        return [5, 0, 0, 0]

    def execute(call: anyhit.ExecuteCall) -> Any:
        records.append(call.record)
        assert call.hit is not None and (call.hit["t"], call.hit["primitive"]) == (4, 0)
        assert call.given[0] == 5
        return [5, 6, 7, 8]

    test = anyhit.ShaderTest(module).buffer(0, 1, np.zeros((1, 16), np.float32))
    outcome = test.on_trace(trace).on_execute(execute).run()
    # Not empty, a hit, no miss; the payload; the interval ends at the hit; record 3 + 0 x 1 + 1; the
    # ray at (1/4, 1/4); a front-facing triangle (0xFE).
    expected = [0, 1, 0, 5, 0.5, 4, 4, 0.25, 0.25, 254, 5, 6, 7, 8]
    assert outcome.read_buffer(0, 1, np.float32)[:14].tolist() == expected
    assert records == [4]


def test_what_moves_is_met_at_the_time_of_the_ray(ball: anyhit.Pipeline) -> None:
    identity = np.eye(3, 4, dtype=np.float32)
    moved = identity.copy()
    moved[2, 3] = -4
    corners = np.array([[4, -1, 0], [6, -1, 0], [5, 1, 0]], np.float32)
    scene = anyhit.Scene(
        [
            anyhit.Instance.spheres([[0, 0, 0]], 0.5).motion(identity, moved),
            anyhit.Instance.triangles(corners).vertices_t1(corners + np.array([0, 0, 2], np.float32)).opaque(),
        ]
    )
    times = np.array([0, 0.25, 1], np.float32)
    # The sphere's upper end is at 1/2 - 4 time, the triangle at 2 time.
    for x, expected in [(0, [3.5, 4.5, 7.5]), (5, [4, 3.5, 2])]:
        traced = ball.trace(scene, [x, 0, 4], [0, 0, -1], time=times)
        assert traced.t.tolist() == expected
    with pytest.raises(anyhit.InvalidArgument, match="end: 2 rows, not 3"):
        anyhit.Instance.spheres([[0, 0, 0]], 0.5).motion(identity, moved[:2])


def test_a_ray_of_a_pipeline_is_explained(ball: anyhit.Pipeline) -> None:
    scene = anyhit.Scene([anyhit.Instance.spheres([[0, 0, 0]], 0.5).custom_index(9)])
    text = ball.explain(scene, anyhit.Ray([0, 0, 4], [0, 0, -1]))
    assert "custom index 9" in text and "3.5" in text and "ClosestHitKHR" in text
    assert "MissKHR" in ball.explain(scene, anyhit.Ray([9, 0, 4], [0, 0, -1]))
    with pytest.raises(anyhit.InvalidArgument, match="flags|known"):
        ball.explain(scene, anyhit.Ray([0, 0, 4], [0, 0, -1]), flags=1 << 25)


def test_records_have_data(ball: anyhit.Pipeline) -> None:
    module, _ = in_box()
    scene = anyhit.Scene([anyhit.Instance.aabbs([[[-1, -1, -1], [1, 1, 1]]])])
    record = np.zeros((4, 4), np.float32)
    for radius, t in [(1, 3), (0.5, 3.5)]:
        record[0, 3] = radius
        given: Any
        for given in [{"spheres": record}, record, record.tobytes()]:
            pipeline = anyhit.Pipeline(hit=[module], hit_records=[given])
            assert pipeline.trace(scene, [0, 0, 4], [0, 0, -1]).t.tolist() == [t]
    with pytest.raises(anyhit.Trap):
        anyhit.Pipeline(hit=[module], hit_records=[None]).trace(scene, [0, 0, 4], [0, 0, -1])
    for wrong, message in [
        ([None, None], "hit_records: 2 elements for 1 records"),
        ([{"spher": [0]}], "no member `spher`"),
        ([7], r"hit_records\[0\]: expected a numpy array"),
        (7, "hit_records: expected a list, found int"),
    ]:
        given = wrong
        with pytest.raises(anyhit.InvalidArgument, match=message):
            anyhit.Pipeline(hit=[module], hit_records=given)


def test_flags_and_include_folders_reach_the_compiler(glslang: None, tmp_path: Path) -> None:
    (tmp_path / "common").mkdir()
    (tmp_path / "common/five.glsl").write_text("#define FIVE 5\n")
    text = """#version 460
    #extension GL_EXT_ray_tracing : require
    #extension GL_GOOGLE_include_directive : require
    #include "five.glsl"
    layout(location = 0) rayPayloadInEXT float p;
    void main() { p = FIVE + MORE; }
    """
    (tmp_path / "a.rmiss").write_text(text)
    folders = [tmp_path / "common"]
    for more in (1, 2):
        flags = [f"-DMORE={more}"]
        for module in [
            anyhit.Module.open(tmp_path / "a.rmiss", include_folders=folders, flags=flags),
            anyhit.Module.from_source("a.rmiss", text, include_folders=folders, flags=flags),
        ]:
            assert anyhit.ShaderTest(module).run().payload == 5 + more
    with pytest.raises(anyhit.InvalidSource):
        anyhit.Module.from_source("a.rmiss", text, flags=["-DMORE=1"])
    with pytest.raises(anyhit.InvalidArgument, match="-o"):
        anyhit.Module.from_source("a.rmiss", text, flags=["-o", "x"])
    with pytest.raises(anyhit.InvalidType, match="flags: expected a list, found str"):
        untyped: Any = "-DMORE=1"
        anyhit.Module.from_source("a.rmiss", text, flags=untyped)
