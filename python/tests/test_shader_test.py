"""One shader by itself."""

from __future__ import annotations

import math
from typing import Any

import anyhit
import numpy as np
import pytest
from conftest import FIXTURES

TRIANGLE = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
DOWN = anyhit.Ray([0, 0, 4], [0, 0, -1])


def test_builtins_follow_from_the_hit(builtins: anyhit.Module) -> None:
    # Moved by (0, 0, 1): in its own space the ray begins at z = 3.
    instance = anyhit.Instance.triangles([TRIANGLE]).translate([0, 0, 1]).custom_index(7)
    test = anyhit.ShaderTest(builtins, "shade").hit(anyhit.Hit(instance, DOWN))
    assert test.payload({"seed": 41}).run().payload == {
        "origin": [0, 0, 3],
        "t": 3,
        "direction": [0, 0, -1],
        "primitive": 0,
        "geometry": 0,
        "custom_index": 7,
        # HitKindFrontFacingTriangleKHR: Vulkan, "Ray Face Culling": the front is where the ray
        # goes against the cross product of the edges.
        "kind": 0xFE,
        "seed": 42,
    }


def test_any_builtin_is_set_by_name(builtins: anyhit.Module) -> None:
    test = anyhit.ShaderTest(builtins, "shade").hit(anyhit.Hit.triangle(TRIANGLE, DOWN))
    test = test.builtin("HitKindKHR", 3).builtin("RayTmax", 2).builtin("ObjectRayOriginKHR", [1, 2, 3])
    payload = test.run().payload
    assert (payload["kind"], payload["t"], payload["origin"]) == (3, 2, [1, 2, 3])
    with pytest.raises(anyhit.InvalidArgument, match="did you mean `HitKindKHR`"):
        test.builtin("HitKnidKHR", 3).run()


def test_positions_and_radii_of_a_linear_swept_sphere() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/lss/normal-angle/main.rchit.spv")
    # A rod along x of radius 1/2, and a ray down at three quarters of its length.
    ray = anyhit.Ray([0.5, 0, 4], [0, 0, -1])
    rod = anyhit.Hit.lss([[-1, 0, 0], [1, 0, 0]], [0.5, 0.5], ray)
    payload = anyhit.ShaderTest(module).hit(rod).run().payload
    assert (payload["t"], payload["u"], payload["exact"]) == (3.5, 0.75, [0, 0, 1])
    # A cone: the sine of its slope is (1/2 - 1/4) / 2, its cosine sqrt(63/64).
    cone = anyhit.Hit.lss([[-1, 0, 0], [1, 0, 0]], [0.5, 0.25], DOWN)
    payload = anyhit.ShaderTest(module).hit(cone).run().payload
    assert payload["exact"] == pytest.approx([0.125, 0, math.sqrt(63 / 64)], abs=1e-6)
    assert payload["angle"] == pytest.approx(math.asin(0.125), abs=1e-6)


def test_a_shader_writes_into_a_buffer() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/builtins/hit/lss.rchit.spv")
    hit = anyhit.Hit.lss([[-1, 0, 0], [1, 0, 2]], [0.5, 0.25], anyhit.Ray([0, 0, 9], [0, 0, -1]))
    # By the names of its members: a runtime array grows to what is set.
    test = anyhit.ShaderTest(module).hit(hit)
    outcome = test.buffer(0, 1, {"outputs": [[{"runs": 1}, {"runs": 2}]]}).run()
    closest, any_hit = outcome.buffer(0, 1)["outputs"][0]
    assert closest["lss"] == [[-1, 0, 0, 0.5], [1, 0, 2, 0.25]]
    assert (closest["is_lss"], closest["runs"], any_hit["runs"]) == (1, 2, 2)
    # As an array of its size it is what its bytes are.
    size = outcome.read_buffer(0, 1, np.uint8).size
    again = test.buffer(0, 1, np.zeros(size // 4, np.float32)).run()
    assert again.read_buffer(0, 1, np.float32).shape == (size // 4,)
    assert again.buffer(0, 1)["outputs"][0][0]["runs"] == 1


def test_a_callback_answers_traces() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/payload/structs/main.rchit.spv")
    hit = anyhit.Hit.sphere([0, 0, 0], 0.5, DOWN)
    seen: list[Any] = []

    def answer(trace: anyhit.TraceCall) -> dict[str, Any]:
        seen.append((trace.number, trace.ray.direction, trace.miss_index))
        return {"counts": [0, 1]}

    outcome = anyhit.ShaderTest(module).hit(hit).on_trace(answer).run()
    assert seen == [(0, [1, 0, 0], 0)]
    assert outcome.traces[0].payload["counts"] == [0, 1]


def test_what_a_callback_raises_is_raised_again() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/payload/structs/main.rchit.spv")

    def answer(trace: anyhit.TraceCall) -> None:
        raise KeyError("no answer")

    test = anyhit.ShaderTest(module).hit(anyhit.Hit.sphere([0, 0, 0], 0.5, DOWN)).on_trace(answer)
    with pytest.raises(KeyError, match="no answer"):
        test.run()


def test_a_trap_is_an_exception_with_its_place() -> None:
    module = anyhit.Module.open(FIXTURES / "fail/memory/array-index/main.rgen.spv")
    test = anyhit.ShaderTest(module).launch([4, 0, 0], [6, 1, 1]).buffer(0, 1, np.zeros(6, np.float32))
    with pytest.raises(anyhit.Trap) as raised:
        test.run()
    trap = raised.value
    assert trap.code == "index_out_of_bounds"
    assert trap.message == "an index is outside its array"
    assert trap.launch_id == (4, 0, 0)
    assert trap.span is not None and trap.span[0].endswith("array-index/main.rgen")
    # table[gl_LaunchIDEXT.x] += 0.5;
    assert trap.line == 11
    assert (trap.stage, trap.entry_point) == ("RayGenerationKHR", "main")
    assert trap.operands == {"kind": "index", "index": 4, "length": 4, "of": "table"}
    assert "index 4 of `table`, which has 4 elements" in str(trap)


def test_mistakes_are_told_by_name(builtins: anyhit.Module) -> None:
    test = anyhit.ShaderTest(builtins, "shade").hit(anyhit.Hit.triangle(TRIANGLE, DOWN))
    with pytest.raises(anyhit.InvalidArgument, match="sede"):
        test.payload({"sede": 1}).run()
    with pytest.raises(anyhit.InvalidArgument, match="float"):
        test.payload({"seed": 1.5}).run()
    with pytest.raises(anyhit.InvalidArgument, match="did you mean `shade`"):
        anyhit.ShaderTest(builtins, "shada")
    with pytest.raises(anyhit.InvalidArgument, match="misses the primitive"):
        beside = anyhit.Ray([9, 0, 4], [0, 0, -1])
        anyhit.ShaderTest(builtins, "shade").hit(anyhit.Hit.triangle(TRIANGLE, beside)).run()


def test_any_hit_shaders_ignore_and_terminate() -> None:
    def run(name: str, primitive: int) -> anyhit.ShaderOutcome:
        module = anyhit.Module.open(FIXTURES / f"pass/any-hit/ignore-and-terminate/{name}.rahit.spv")
        return anyhit.ShaderTest(module).builtin("PrimitiveId", primitive).payload({"seen": 5}).run()

    ignored = run("ignore", 2)
    # What the payload got before the ignore counts.
    assert (ignored.exit, ignored.payload["seen"]) == ("Ignored", 6)
    assert run("ignore", 3).exit == "Returned"
    assert run("terminate", 3).exit == "Terminated"


def test_reports_of_an_intersection_shader() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/intersection/sphere-in-box/main.rint.spv")
    hit = anyhit.Hit.aabb([-1, -1, -1], [1, 1, 1], DOWN)
    test = anyhit.ShaderTest(module).hit(hit).shader_record({"spheres": [[0, 0, 0, 1], *[[0] * 4] * 3]})
    reports = test.run().reports
    # The far root first: z = -1 and z = 1, from z = 4.
    assert [(one["t"], one["kind"], one["accepted"]) for one in reports] == [(5, 6, True), (3, 5, True)]
    assert reports[1]["attributes"]["normal"] == [0, 0, 1]
    assert not any(one["accepted"] for one in test.reject_reports().run().reports)


def test_records_push_constants_and_operands_of_a_trace() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/resources/record-and-push-constants/main.rgen.spv")
    constants = {
        "basis": [[1, 0, 0], [0, 1, 0]],
        "scale": [0.5, 2],
        "miss": 1,
        "sbt_offset": 3,
        "values": [1, 2, 3],
    }
    test = anyhit.ShaderTest(module).launch([2, 0, 0], [4, 1, 1]).push_constants(constants)
    test = test.shader_record({"origin": [0, 0, 5], "t_max": 50}).buffer(0, 1, np.zeros((4, 2, 4), np.float32))
    outcome = test.on_trace(lambda trace: [9, 8, 7, 6]).run()
    # basis * (scale * (2, values[2])) = (1, 6), and values[0] + values[1] behind it.
    written = outcome.read_buffer(0, 1, np.float32).reshape(4, 2, 4)
    assert written[2].tolist() == [[9, 8, 7, 6], [1, 6, 5, 3]]
    (trace,) = outcome.traces
    assert (trace.miss_index, trace.sbt_offset, trace.sbt_stride, trace.cull_mask) == (1, 3, 1, 0xFF)
    assert (trace.ray.origin, trace.ray.t_max, trace.given) == ([1, 6, 5], 50, [-1, -1, -1, -1])


def test_a_callback_answers_calls() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/callable/operations/main.rgen.spv")
    seen: list[Any] = []

    def answer(index: int, data: dict[str, Any]) -> dict[str, Any]:
        seen.append((index, data))
        return {"result": 7, "calls": 1}

    test = anyhit.ShaderTest(module).launch([1, 0, 0], [3, 1, 1]).buffer(0, 1, np.zeros((3, 4), np.float32))
    outcome = test.on_call(answer).run()
    assert seen == [(1, {"values": [2, 2], "result": -1, "calls": 0})]
    assert outcome.read_buffer(0, 1, np.float32)[4:8].tolist() == [2, 2, 7, 1]


def test_the_sanitizer_judges_a_shader() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/sphere/closest-hit/main.rchit.spv")
    test = anyhit.ShaderTest(module).hit(anyhit.Hit.sphere([0, 0, 0], 0.5, DOWN)).payload({"hits": 1})
    assert test.sanitize() == []
    assert "ClosestHitKHR" in test.run().explain()
