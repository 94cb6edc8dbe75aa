"""What the crate has beyond hits and launches: records, motion, hit objects, explanations, flags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import anyhit
import numpy as np
import pytest
from conftest import FIXTURES, REPOSITORY

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


def test_buffers_have_device_addresses() -> None:
    # It lists five nodes from `first` on, `uint value; uint pad; Node next;`; the next becomes 77.
    module = anyhit.Module.open(REPOSITORY / "tests/scenes/addresses/nodes.spv")
    buffers = anyhit.DeviceBuffers()
    first = buffers.reserve("first", 16)
    second = buffers.add("second", np.array([4, first], np.uint64))
    buffers.write("first", np.array([3, second], np.uint64))
    test = anyhit.ComputeTest(module).device_buffers(buffers).buffer(0, 0, np.zeros(6, np.uint32))
    # What is written later is not part of the test.
    buffers.write("first", np.array([9, 0], np.uint64))
    outcome = test.push_constants({"first": first}).run()
    assert outcome.read_buffer(0, 0, np.uint32).tolist() == [3, 4, 3, 4, 3, 0]
    assert outcome.read_buffer_at(second, np.uint64).tolist() == [77, first]
    for wrong in [0, 5, 2**64 - 1]:
        with pytest.raises(anyhit.InvalidArgument, match="no buffer contains address"):
            outcome.read_buffer_at(wrong)
    with pytest.raises(anyhit.InvalidArgument):
        buffers.write("third", b"")
    with pytest.raises(anyhit.InvalidArgument, match="size: "):
        buffers.reserve("huge", -1)
    scene = anyhit.Scene([])
    assert buffers.structure(scene) == buffers.structure(scene) not in (first, second)
    with pytest.raises(anyhit.InvalidArgument, match="limit"):
        buffers.reserve("huge", 2**60)


def test_tests_are_debugged() -> None:
    module = anyhit.Module.open(PASS / "sphere/closest-hit/main.rchit.spv")
    ray = anyhit.Ray([0, 0, 4], [0, 0, -1])
    test = anyhit.ShaderTest(module).hit(anyhit.Hit.sphere([0, 0, 0], 0.5, ray))
    assert test.debug("print gl_HitTEXT").endswith("(anyhit) print gl_HitTEXT\ngl_HitTEXT = float 3.5\n")
    with pytest.raises(anyhit.InvalidArgument):
        test.debug("no such command")
    compute = anyhit.Module.from_source(
        "c.wgsl",
        "@group(0) @binding(0) var<storage, read_write> a: array<u32>;\n"
        "@compute @workgroup_size(2) fn main(@builtin(global_invocation_id) id: vec3u) { a[id.x] = id.x; }",
    )
    dispatch = anyhit.ComputeTest(compute).buffer(0, 0, np.zeros(2, np.uint32))
    transcript = dispatch.debug([1, 0, 0], "print gl_GlobalInvocationID")
    assert transcript.endswith("gl_GlobalInvocationID = uvec3(1, 0, 0)\n")
    with pytest.raises(anyhit.InvalidArgument):
        dispatch.debug([9, 0, 0], "print id")


def test_outcomes_know_the_exact_normal() -> None:
    module = anyhit.Module.open(PASS / "sphere/closest-hit/main.rchit.spv")
    ray = anyhit.Ray([0, 0, 4], [0, 0, -1])
    outcome = anyhit.ShaderTest(module).hit(anyhit.Hit.sphere([0, 0, 0], 0.5, ray)).run()
    # The upper pole of the sphere.
    assert outcome.exact_normal == [0, 0, 1] == outcome.exact_object_normal
    outcome.check_normal("normal", 0.01)
    with pytest.raises(anyhit.InvalidArgument):
        outcome.check_normal("norm", 0.01)
    assert (outcome.executes, outcome.calls) == ([], [])


def test_instances_of_a_scene_file_move() -> None:
    scene = anyhit.Scene.open(REPOSITORY / "shaders/pass/sphere/closest-hit/scene.toml")
    before = scene.transform(0)
    assert before.shape == (3, 4) and before.dtype == np.float32
    moved = before + np.array([[0, 0, 0, 1]] * 3, np.float32)
    scene.set_transform(0, moved)
    assert (scene.transform(0) == moved).all()
    scene.set_motion(0, before, moved)
    assert (scene.transform(0) == before).all()
    with pytest.raises(anyhit.InvalidArgument, match="no instance 99"):
        scene.transform(99)
    scene.set_max_recursion(1)


def test_a_module_is_validated() -> None:
    assert anyhit.Module.open(PASS / "sphere/closest-hit/main.rchit.spv").validate() == []
