"""Arrays and the layouts of shaders: structured dtypes, reflection, names."""

from __future__ import annotations

import array
import struct
import time
from typing import Any, Callable

import anyhit
import numpy as np
import pytest

# WGSL's rules (W3C, "Memory layouts"): a vec3f is aligned to 16 bytes, a struct to its largest
# member. Light: p at 0, c at 16, k at 28, 32 bytes. Params: count at 0, sun at 16, m at 48 (columns
# 16 bytes apart), sizes at 96.
SHADER = """
enable wgpu_ray_tracing_pipeline;

struct Light { p: vec3f, c: vec3f, k: i32 }
struct Params { count: u32, sun: Light, m: mat3x3f, sizes: array<f32> }

@group(0) @binding(0) var<storage, read> lights: array<Light>;
@group(0) @binding(1) var<storage, read_write> sums: array<f32>;
@group(1) @binding(0) var<storage, read_write> params: Params;
@group(1) @binding(1) var<storage, read_write> points: array<vec3f>;
@group(1) @binding(2) var<uniform> two: array<vec4u, 2>;
@group(1) @binding(3) var<storage, read> single: Light;

@ray_generation
fn add(@builtin(ray_invocation_id) id: vec3u) {
    sums[id.x] = lights[id.x].c.y + f32(lights[id.x].k) + single.p.x * f32(two[0].x);
}

@compute @workgroup_size(1)
fn fill(@builtin(global_invocation_id) id: vec3u) {
    if (id.x == 0u) { params.count += 1u; }
    params.m[2].y = 7.0;
    params.sizes[1] = params.sun.c.z;
    points[id.x] = vec3f(f32(id.x), 2.0, 3.0);
    sums[0] = f32(two[1].y);
}
"""

LIGHT = np.dtype(
    {
        "names": ["p", "c", "k"],
        "formats": [("<f4", 3), ("<f4", 3), "<i4"],
        "offsets": [0, 16, 28],
        "itemsize": 32,
    }
)


@pytest.fixture(scope="module")
def module() -> anyhit.Module:
    return anyhit.Module.from_source("layouts.wgsl", SHADER)


def lights(dtype: Any, count: int = 3) -> Any:
    made: Any = np.zeros(count, dtype)
    made["c"] = [1, 2, 3]
    made["k"] = 10
    return made


def launch(module: anyhit.Module, given: Any) -> Any:
    single: Any = np.zeros(1, LIGHT)
    single["p"] = [4, 0, 0]
    scene = anyhit.Scene([]).buffer(0, 0, given).buffer("sums", np.zeros(3, np.float32))
    scene = scene.buffer("two", np.array([[3, 0, 0, 0], [0, 5, 0, 0]], np.uint32)).buffer("single", single)
    pipeline = anyhit.Pipeline(ray_generation=anyhit.Program(module, "add"))
    return pipeline.launch(scene, 3).read_buffer("sums").tolist()


def test_structs_have_the_layout_of_the_shader(module: anyhit.Module) -> None:
    assert launch(module, lights(LIGHT)) == [2 + 10 + 12] * 3
    assert launch(module, lights(module.buffer_dtype("lights"))) == [24] * 3
    # Padding may have a name, or be bytes without a type.
    padded = [("p", "<f4", 3), ("pad", "<f4"), ("c", "<f4", 3), ("k", "<i4")]
    assert launch(module, lights(padded)) == [24] * 3
    assert launch(module, lights([padded[0], ("x", "V4"), *padded[2:]])) == [24] * 3
    # Bytes have no type.
    assert launch(module, lights(LIGHT).view(np.uint8)) == [24] * 3
    assert launch(module, lights(LIGHT).tobytes()) == [24] * 3
    assert launch(module, memoryview(lights(LIGHT).tobytes())) == [24] * 3


@pytest.mark.parametrize(
    ("dtype", "message"),
    [
        # Without padding the second member lies elsewhere.
        ([("p", "<f4", 3), ("c", "<f4", 3), ("k", "<i4")], "`c` begins at byte 16 in the shader, at byte 12"),
        # Swapped members of the same type.
        ([("c", "<f4", 3), ("pad", "<f4"), ("p", "<f4", 3), ("k", "<i4")], "begins at byte"),
        # Another class, width or byte order.
        ([("p", "<f4", 3), ("pad", "<f4"), ("c", "<f4", 3), ("k", "<f4")], "an integer of 32 bits"),
        ([("p", "<f8", 3), ("c", "<f4", 3), ("k", "<i4")], "a float of 64 bits"),
        ([("p", "<f4", 3), ("pad", "<f4"), ("c", "<f4", 3), ("k", ">i4")], "byte order"),
        # More bytes for each element.
        (
            [("p", "<f4", 3), ("pad", "<f4"), ("c", "<f4", 3), ("k", "<i4"), ("more", "<f4", 4)],
            "where|after the shader's last member",
        ),
        ([("p", "<f4", 3), ("pad", "<f4"), ("c", "<f4", 3), ("k", "S4")], "no equivalent in a shader"),
        ([("p", "<c8", 3), ("pad", "<f4"), ("c", "<f4", 3), ("k", "<i4")], "no equivalent in a shader"),
    ],
)
def test_other_structs_are_refused(module: anyhit.Module, dtype: Any, message: str) -> None:
    with pytest.raises(anyhit.InvalidArgument, match=message):
        launch(module, np.zeros(4, dtype))


def test_a_struct_alone_is_one_element(module: anyhit.Module) -> None:
    scene = anyhit.Scene([]).buffer(0, 0, lights(LIGHT)).buffer(0, 1, np.zeros(3, np.float32))
    scene = scene.buffer("two", bytes(32))
    pipeline = anyhit.Pipeline(ray_generation=anyhit.Program(module, "add"))
    pipeline.launch(scene.buffer("single", np.zeros((), LIGHT)), 3)
    with pytest.raises(anyhit.InvalidArgument, match="buffer 3 of set 1"):
        pipeline.launch(scene.buffer("single", np.zeros(2, LIGHT)), 3)


def fill(module: anyhit.Module) -> anyhit.ComputeTest:
    test = anyhit.ComputeTest(module, "fill")
    values = {"count": 4, "sun": {"c": [0, 0, 9]}, "sizes": [1, 2, 3]}
    test = test.buffer("params", values).buffer("points", bytes(2 * 16)).workgroups(2)
    return test.buffer("sums", np.zeros(1, np.float32)).buffer("two", [[0] * 4, [0, 6, 0, 0]])


def test_buffers_are_read_as_the_shader_declares_them(module: anyhit.Module) -> None:
    outcome = fill(module).run()
    points = outcome.read_buffer("points")
    # A row for each vec3f, whose padding is no number.
    assert (points.dtype, points.tolist()) == (np.dtype("<f4"), [[0, 2, 3], [1, 2, 3]])
    assert outcome.read_buffer(0, 1).tolist() == [6]
    params = outcome.read_buffer("params")
    assert params.shape == () and int(params["count"]) == 5
    assert params["sizes"].tolist() == [1, 9, 3]
    assert params["sun"]["c"].tolist() == [0, 0, 9]
    # Columns of a matrix have padding: a struct of one member.
    assert params["m"]["column"].tolist() == [[0, 0, 0], [0, 0, 0], [0, 7, 0]]
    # What was read can be bound again, and a dtype reads the bytes by it.
    again = fill(module).buffer("params", outcome.read_buffer("params", np.uint8)).run()
    assert again.buffer("params")["count"] == 6
    assert outcome.read_buffer("params", np.uint32)[0] == 5
    with pytest.raises(anyhit.InvalidArgument, match="no whole number"):
        outcome.read_buffer("points", np.dtype("V5"))
    assert outcome.read_buffer("two").tolist() == [[0] * 4, [0, 6, 0, 0]]


def test_dtypes_are_those_of_the_module(module: anyhit.Module) -> None:
    assert module.buffer_dtype("lights") == LIGHT == module.buffer_dtype(0, 0)
    assert module.buffer_dtype("single") == LIGHT
    assert module.buffer_dtype("sums") == np.dtype("<f4")
    assert module.buffer_dtype("two") == np.dtype(("<u4", (4,)))
    params = module.buffer_dtype("params", count=5)
    assert params.fields is not None
    assert [params.fields[name][1] for name in ("count", "sun", "m", "sizes")] == [0, 16, 48, 96]
    assert params["sizes"].shape == (5,) and params.itemsize >= 116
    with pytest.raises(anyhit.InvalidArgument, match="no shader uses a binding named `ligths`"):
        module.buffer_dtype("ligths")
    with pytest.raises(anyhit.InvalidArgument, match="no buffer is declared at set 0, binding 9"):
        module.buffer_dtype(0, 9)


def test_a_module_lists_its_bindings(module: anyhit.Module) -> None:
    found = [(one.name, one.set, one.binding) for one in module.bindings]
    assert found == [
        ("lights", 0, 0),
        ("sums", 0, 1),
        ("params", 1, 0),
        ("points", 1, 1),
        ("two", 1, 2),
        ("single", 1, 3),
    ]
    types = {one.name: one.type for one in module.bindings}
    assert types["lights"] == "storage_buffer"
    assert types["two"] == "uniform_buffer"
    assert module.bindings == module.bindings and len(set(module.bindings)) == 6


def test_structs_of_numpy_are_values(module: anyhit.Module) -> None:
    test = fill(module)
    single = lights(LIGHT, 1)
    for value in (single[0], single.reshape(()), {"p": single[0]["p"], "c": [1, 2, 3], "k": 10}):
        sun = test.buffer("params", {"sun": value, "sizes": [0, 0]}).run().buffer("params")["sun"]
        assert sun == {"p": [0, 0, 0], "c": [1, 2, 3], "k": 10}
    with pytest.raises(anyhit.InvalidArgument, match="no member `q`"):
        test.buffer("params", {"sun": np.zeros((), [("q", "f4")])})


def test_values_are_written_at_their_offsets(module: anyhit.Module) -> None:
    data = {"count": 1, "sun": {"k": -2}, "m": np.arange(9).reshape(3, 3), "sizes": np.array([0.5], np.float16)}
    scene = anyhit.Scene([]).buffer(1, 0, data, module=module)
    content = scene.read_buffer(1, 0).tobytes()
    assert struct.unpack_from("<I", content, 0) == (1,)
    assert struct.unpack_from("<i", content, 16 + 28) == (-2,)
    assert [struct.unpack_from("<3f", content, 48 + 16 * column) for column in range(3)] == [
        (0, 1, 2),
        (3, 4, 5),
        (6, 7, 8),
    ]
    assert struct.unpack_from("<f", content, 96) == (0.5,)


def test_outcomes_and_scenes_are_values(module: anyhit.Module) -> None:
    test = fill(module)
    one, other = test.run(), test.run()
    assert one == other and one.buffer("params")["count"] == 5
    changed = test.buffer("params", {"count": 6, "sizes": [0, 0]}).run()
    assert changed != one and one.buffer("params")["count"] == 5
    pipeline = anyhit.Pipeline(ray_generation=anyhit.Program(module, "add"))
    scene = anyhit.Scene([]).buffer("lights", lights(LIGHT)).buffer("sums", np.zeros(3, np.float32))
    scene = scene.buffer("two", bytes(32)).buffer("single", bytes(32))
    first = pipeline.launch(scene, 3)
    brighter = lights(LIGHT)
    brighter["k"] = 20
    second = pipeline.launch(scene.buffer("lights", brighter), 3)
    assert first.read_buffer("sums").tolist() == [12] * 3
    assert second.read_buffer("sums").tolist() == [22] * 3
    assert first != second and first == pipeline.launch(scene, 3)
    assert scene.read_buffer("sums", np.float32).tolist() == [0] * 3


def test_whatever_has_an_array_is_one(module: anyhit.Module) -> None:
    class Tensor:
        """As a tensor of another package."""

        def __init__(self, array: Any) -> None:
            self.array = array

        def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
            return self.array

    test = fill(module)
    given: Any
    for given in [array.array("f", [4, 5]), Tensor(np.array([4, 5], np.float32))]:
        assert test.buffer("sums", given).run().read_buffer("sums").tolist() == [6, 5]
        scene = anyhit.Scene([anyhit.Instance.spheres([[0, 0, 0], [4, 0, 0]], given)])
        assert repr(scene) == "<anyhit.Scene: 1 instance>"
    for given in [array.array("d", [4, 5]), Tensor(np.array([4.5, 5]))]:
        with pytest.raises(anyhit.InvalidArgument, match="given as `f64`"):
            test.buffer("sums", given).run()
    masks: Any = np.ma
    masked = masks.masked_array(np.ones(2, np.float32), [True, False])
    calls: list[Callable[[], object]] = [
        lambda: test.buffer("sums", masked),
        lambda: anyhit.Instance.spheres([[0, 0, 0], [4, 0, 0]], masked),
        lambda: test.buffer("params", {"sizes": masked}),
    ]
    for call in calls:
        with pytest.raises(anyhit.InvalidArgument, match="has a mask"):
            call()


def test_buffers_of_millions_of_numbers_are_read_by_numpy(module: anyhit.Module) -> None:
    test = fill(module)
    many = np.arange(2_000_000, dtype=np.float32)
    outcome = test.buffer("sums", many).run()
    began = time.monotonic()
    values = outcome.buffer("sums")
    took = time.monotonic() - began
    (numbers,) = values.values() if isinstance(values, dict) else (values,)
    assert numbers[:3] == [6, 1, 2] and len(numbers) == 2_000_000 and isinstance(numbers[1], float)
    began = time.monotonic()
    outcome.read_buffer("sums").tolist()
    assert took < 20 * (time.monotonic() - began) + 1
    # Elements with padding, members before the array, and an array without elements.
    assert outcome.buffer("points")["_0"] == [[0, 2, 3], [1, 2, 3]]
    assert outcome.buffer("params")["sizes"] == [1, 9, 3]
    assert outcome.buffer("params")["sun"]["c"] == [0, 0, 9]
    empty = anyhit.Module.from_source("e.wgsl", EMPTY)
    assert anyhit.ComputeTest(empty).buffer(0, 0, bytes(4)).run().buffer(0, 0) == {"count": 0, "rest": []}


EMPTY = """
struct Counted { count: u32, rest: array<f32> }
@group(0) @binding(0) var<storage, read_write> counted: Counted;
@compute @workgroup_size(1) fn main() { counted.count = arrayLength(&counted.rest); }
"""
