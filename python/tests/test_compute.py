"""Compute shaders: arrays in and out, groups, shared memory, constants, ray queries."""

from __future__ import annotations

from typing import Any

import anyhit
import numpy as np
import pytest
from conftest import FIXTURES

SUMS = """
struct Settings { factor: u32 }

@group(0) @binding(0) var<storage, read> numbers: array<u32>;
@group(0) @binding(1) var<storage, read_write> sums: array<u32>;
@group(1) @binding(0) var<uniform> settings: Settings;
var<workgroup> parts: array<u32, 4>;

@compute @workgroup_size(4)
fn sum(
    @builtin(local_invocation_index) local: u32,
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
) {
    parts[local] = numbers[id.x];
    workgroupBarrier();
    if (local == 0u) {
        sums[group.x] = settings.factor * (parts[0] + parts[1] + parts[2] + parts[3]);
    }
}
"""
NUMBERS = np.array([1, 2, 3, 4, 10, 20, 30, 40], np.uint32)


@pytest.fixture(scope="module")
def test() -> anyhit.ComputeTest:
    module = anyhit.Module.from_source("sums.wgsl", SUMS)
    return anyhit.ComputeTest(module, "sum").buffer("settings", {"factor": 3})


def test_arrays_go_in_and_come_out(test: anyhit.ComputeTest) -> None:
    found = test.run({"numbers": NUMBERS}, {"sums": 2}, groups=2)
    assert list(found) == ["sums"] and found["sums"].dtype == np.uint32
    assert found["sums"].tolist() == [30, 300]
    # Keys are names, bindings of set 0, or both numbers; outputs begin with data or zeros.
    found = test.run({0: NUMBERS, (1, 0): {"factor": 1}}, {(0, 1): np.full((3, 1), 7, np.int32)}, groups=(2, 1, 1))
    assert found[(0, 1)].tolist() == [[10], [100], [7]] and found[(0, 1)].dtype == np.int32
    # A list of outputs reads what is bound; outputs may be inputs, too.
    bound = test.buffer("sums", np.zeros(2, np.uint32)).workgroups(2)
    assert bound.run({"numbers": NUMBERS}, ["sums", 0])["sums"].tolist() == [30, 300]
    assert bound.run({"numbers": NUMBERS}, ["sums", 0])[0].tolist() == NUMBERS.tolist()
    # The test is as it was.
    with pytest.raises(anyhit.Error):
        test.run()


def test_a_run_leaves_an_outcome(test: anyhit.ComputeTest) -> None:
    test = test.buffer("numbers", NUMBERS).buffer("sums", np.zeros(2, np.uint32)).workgroups(2)
    outcome = test.run()
    assert outcome.read_buffer("sums").tolist() == [30, 300]
    assert outcome.stats["GLCompute"] == 8
    assert outcome == test.run() != test.buffer("settings", {"factor": 1}).run()
    assert outcome.printed == []
    assert test.sanitize() == []


@pytest.mark.parametrize(
    ("inputs", "outputs", "groups", "message"),
    [
        ({"number": NUMBERS}, None, 1, "no shader uses a binding named `number`: the names are"),
        ({"numbers": NUMBERS.astype(np.float32)}, {"sums": 1}, 1, "`numbers` is uint, given as `f32`|given as `f32`"),
        ({"numbers": NUMBERS}, {"sums": -1}, 1, "a number of elements: -1 is out of the range"),
        ({"numbers": NUMBERS}, {"sums": 2**63}, 1, "limit|large"),
        ({"numbers": NUMBERS}, "sums", 1, "outputs: expected a dict or a list of bindings, found str"),
        ([NUMBERS], None, 1, "inputs: expected dict, found list"),
        ({"numbers": NUMBERS}, {"sums": 1}, (1, 1, 1, 1), "groups: expected int or up to three of them"),
        ({"numbers": NUMBERS}, {"sums": 1}, 2**32, "groups: 4294967296 is out of the range"),
        ({(0, 0, 0): NUMBERS}, None, 1, "a key of 3 parts"),
    ],
)
def test_mistakes_are_named(test: anyhit.ComputeTest, inputs: Any, outputs: Any, groups: Any, message: str) -> None:
    with pytest.raises(anyhit.InvalidArgument, match=message):
        test.run(inputs, outputs, groups=groups)


def test_a_trap_has_the_place_and_a_finding_is_denied() -> None:
    module = anyhit.Module.open(FIXTURES / "sanitize/frem-zero/broken.comp.spv")
    # The time of a clip is taken modulo its length, which is 0 for the second of four.
    clips = np.zeros((5, 4), np.float32)
    clips[0, 0] = 7.5
    clips[1:, 0] = [2, 0, 0.5, 10]
    clips[1:, 1] = 24
    clips[1:, 3] = 1
    test = anyhit.ComputeTest(module).buffer(0, 1, np.zeros(4, np.float32)).buffer(0, 2, clips)
    with pytest.raises(anyhit.Finding, match="the remainder of 7.5 divided by zero"):
        test.sanitize()
    with pytest.raises(anyhit.Trap):
        endless = anyhit.Module.from_source(
            "loop.wgsl",
            "@group(0) @binding(0) var<storage, read_write> a: u32;\n"
            "@compute @workgroup_size(1) fn main() { loop { a += 1u; if (a == 0u) { break; } } }",
        )
        anyhit.ComputeTest(endless).buffer(0, 0, np.zeros(1, np.uint32)).fuel(1000).run()


def test_ray_queries_meet_a_scene() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/ray-query/compute/main.comp.spv")
    corners = [[[0, 0, 0], [15.5, 0, 0], [0, 15.5, 0]]]
    scene = anyhit.Scene([anyhit.Instance.triangles(corners)])
    test = anyhit.ComputeTest(module).scene(0, 0, scene).workgroups(1, 2)
    # The rays at (x + 1/2, y + 1/2) that hit have x + y <= 14: 15 + 14 + 13 + 12 in the rows 0 to 3,
    # and 11 + 10 + 9 + 8 in the rows 4 to 7.
    found = test.run(outputs={1: np.zeros(2, np.uint32)})
    assert found[1].tolist() == [54, 38]


def test_constants_and_push_constants_are_set(glslang: None) -> None:
    text = """#version 460
    layout(local_size_x_id = 1) in;
    layout(constant_id = 2) const uint N = 5;
    layout(push_constant) uniform Push { uint more; float scale; };
    layout(set = 0, binding = 0) buffer Results { uint results[]; };
    void main() { results[gl_GlobalInvocationID.x] = N + more + uint(scale * 2); }
    """
    module = anyhit.Module.from_source("c.comp", text)
    test = anyhit.ComputeTest(module, specialization={1: 3, 2: 100})
    test = test.push_constants({"more": 20, "scale": 1.5})
    # Three invocations of each group.
    assert test.run(outputs={"Results": 7}, groups=2)["Results"].tolist() == [123] * 6 + [0]
    with pytest.raises(anyhit.InvalidArgument, match="`more`"):
        test.push_constants({"more": -1})


RACE = """
@group(0) @binding(0) var<storage, read_write> last: u32;
@group(0) @binding(1) var<storage, read_write> sum: atomic<u32>;

@compute @workgroup_size(64)
fn race(@builtin(global_invocation_id) id: vec3u) {
    last = id.x;
    atomicAdd(&sum, 1u);
}

@compute @workgroup_size(64)
fn count() { atomicAdd(&sum, 1u); }
"""


def test_drawn_choices_are_found() -> None:
    module = anyhit.Module.from_source("race.wgsl", RACE)
    zero = np.zeros(1, np.uint32)
    # Which invocation stores last is open; a sum of atomic instructions is not.
    race = anyhit.ComputeTest(module, "race").buffer("last", zero).buffer("sum", zero)
    with pytest.raises(anyhit.Finding, match="`last`.*invocations run in another order"):
        race.many_seeds(8)
    count = anyhit.ComputeTest(module, "count").buffer("sum", zero).workgroups(2)
    assert count.many_seeds(8) == []
    # A block that is no array is an element without dimensions.
    total = count.run().read_buffer("sum")
    assert (total.shape, total.tolist()) == ((), 128)
    with pytest.raises(anyhit.InvalidArgument, match="seed"):
        count.many_seeds(0)
    # A tile of which nobody writes 5 pixels: shaders/many-seeds/workgroup-drawn.
    broken, mended = (
        anyhit.ComputeTest(anyhit.Module.open(FIXTURES / f"many-seeds/workgroup-drawn/{name}.comp.spv"))
        .buffer(0, 1, np.array([1] * 8 + [0.5] * 3, np.float32))
        .buffer(0, 2, np.zeros(2, np.float32))
        .workgroups(2)
        for name in ("broken", "mended")
    )
    with pytest.raises(anyhit.Finding, match="workgroup memory holds something else at the beginning"):
        broken.many_seeds(8)
    assert mended.many_seeds(8) == []


def test_an_invocation_is_explained(test: anyhit.ComputeTest) -> None:
    test = test.buffer("numbers", NUMBERS).buffer("sums", np.zeros(2, np.uint32)).workgroups(2)
    text = test.explain([4, 0, 0])
    # 3 * (10 + 20 + 30 + 40)
    assert "wrote  sums[1]: uint 0 -> 300" in text and "invocation (4, 0, 0)" in text
    assert "no changed value" in test.explain([5, 0, 0])
    assert test.run().read_buffer("sums").tolist() == [30, 300]
    with pytest.raises(anyhit.InvalidArgument, match="invocation 8,0,0 is outside the dispatch"):
        test.explain([8, 0, 0])
    # A trap is part of it.
    short = test.buffer("sums", np.zeros(1, np.uint32))
    assert "trap   a buffer is accessed outside its range" in short.explain([4, 0, 0])


def test_ray_queries_are_explained() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/ray-query/compute/main.comp.spv")
    scene = anyhit.Scene([anyhit.Instance.triangles([[[0, 0, 0], [15.5, 0, 0], [0, 15.5, 0]]])])
    test = anyhit.ComputeTest(module).scene(0, 0, scene).buffer(0, 1, np.zeros(1, np.uint32))
    assert "ray query" in test.explain([0, 0, 0])
