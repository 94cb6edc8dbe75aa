"""Images have the format and the dimension that shaders declare."""

from __future__ import annotations

from typing import Any

import anyhit
import numpy as np
import pytest

STORE = """
enable wgpu_ray_tracing_pipeline;

@group(0) @binding(0) var picture: texture_storage_2d<%s, read_write>;
@group(0) @binding(1) var<storage, read_write> read: vec4<%s>;

@ray_generation
fn store() {
    textureStore(picture, vec2i(0, 0), vec4<%s>(%s));
    read = textureLoad(picture, vec2i(0, 0));
}

@compute @workgroup_size(1)
fn stored() {
    textureStore(picture, vec2i(0, 0), vec4<%s>(%s));
    read = textureLoad(picture, vec2i(0, 0));
}
"""

HALF = float(np.float16(0.1))
# Vulkan, "Conversion From Floating-Point to Normalized Fixed-Point": clamped to 0 and 1 (-1 and 1),
# times 2^b - 1 (2^(b - 1) - 1), rounded to an integer. Missing components are 0, a missing A is 1.
FORMATS = [
    ("rgba32float", "f32", "2.0, -1.0, 0.1, 0.5", [2, -1, float(np.float32(0.1)), 0.5]),
    ("rgba16float", "f32", "2.0, -1.0, 0.1, 0.5", [2, -1, HALF, 0.5]),
    ("rgba8unorm", "f32", "2.0, -1.0, 0.25, 0.5", [1, 0, 64 / 255, 128 / 255]),
    ("rgba8snorm", "f32", "2.0, -2.0, 0.25, 0.0", [1, -1, 32 / 127, 0]),
    ("r32float", "f32", "2.0, -1.0, 0.1, 0.5", [2, 0, 0, 1]),
    ("rg32float", "f32", "2.0, -1.0, 0.1, 0.5", [2, -1, 0, 1]),
    ("rgba8uint", "u32", "7u, 255u, 0u, 1u", [7, 255, 0, 1]),
    ("rgba32uint", "u32", "7u, 4294967295u, 0u, 1u", [7, 2**32 - 1, 0, 1]),
    ("r32uint", "u32", "7u, 1u, 1u, 9u", [7, 0, 0, 1]),
    ("rgba16sint", "i32", "-7i, 32767i, -32768i, 1i", [-7, 32767, -32768, 1]),
    ("r32sint", "i32", "-7i, 1i, 1i, 9i", [-7, 0, 0, 1]),
]
DTYPES: dict[str, Any] = {"f32": np.float32, "u32": np.uint32, "i32": np.int32}


@pytest.mark.parametrize(("name", "ty", "texel", "expected"), FORMATS, ids=[one[0] for one in FORMATS])
def test_texels_are_stored_in_the_format(name: str, ty: str, texel: str, expected: list[float]) -> None:
    module = anyhit.Module.from_source("store.wgsl", STORE % (name, ty, ty, texel, ty, texel))
    pipeline = anyhit.Pipeline(ray_generation=anyhit.Program(module, "store"))
    texels: Any = np.zeros((1, 2, 4), DTYPES[ty])
    scene = anyhit.Scene([]).image("picture", texels).buffer("read", np.zeros(4, DTYPES[ty]))
    launched = pipeline.launch(scene, 1)
    test = anyhit.ComputeTest(module, "stored").image(0, 0, texels).buffer(0, 1, np.zeros(4, DTYPES[ty]))
    outcome = test.run()
    for result in (launched, outcome):
        image = result.image("picture")
        assert image.dtype == DTYPES[ty] and image.shape == (1, 2, 4)
        assert image[0, 0].tolist() == pytest.approx(expected, rel=1e-6)
        assert result.read_buffer("read").tolist() == pytest.approx(expected, rel=1e-6)
    # The next launch begins with it, in the same format.
    assert pipeline.launch(launched.scene, 1).image(0, 0).tolist() == image.tolist()


def test_texels_of_another_kind_are_refused() -> None:
    module = anyhit.Module.from_source("store.wgsl", STORE % ("r32uint", "u32", "u32", "1u,0u,0u,0u", "u32", "1u,0u,0u,0u"))
    pipeline = anyhit.Pipeline(ray_generation=anyhit.Program(module, "store"))
    scene = anyhit.Scene([]).buffer(0, 1, np.zeros(4, np.uint32))
    floats = scene.image(0, 0, np.zeros((1, 1, 4), np.float32))
    with pytest.raises(anyhit.InvalidArgument, match=r"format r32ui: use `texels.astype\(numpy.uint32\)`"):
        pipeline.launch(floats, 1)
    # A format that the caller names, and the shader does not declare.
    other = scene.image(0, 0, np.zeros((1, 1, 4), np.uint32), format="rgba8ui")
    with pytest.raises(anyhit.InvalidArgument, match="the shader declares the format r32ui") as raised:
        pipeline.launch(other, 1)
    assert "leave out `format`" in str(raised.value)
    with pytest.raises(anyhit.InvalidArgument, match="there is no format `rgba`"):
        scene.image(0, 0, np.zeros((1, 1, 4), np.float32), format="rgba")
    wrong: Any
    for wrong in [np.zeros(4, np.uint32), np.zeros((1, 1, 5), np.uint32), np.zeros((1, 1, 1, 4), np.uint32)]:
        with pytest.raises(anyhit.InvalidArgument, match="texels: an array of shape"):
            pipeline.launch(scene.image(0, 0, wrong), 1)
    # One component needs no axis of its own.
    for fine in [np.ones((1, 1), np.uint32), np.ones((1, 1, 1), np.uint32)]:
        assert pipeline.launch(scene.image(0, 0, fine), 1).image(0, 0).tolist() == [[[1, 0, 0, 1]]]


SAMPLE = """
@group(0) @binding(0) var line: texture_1d<f32>;
@group(0) @binding(1) var volume: texture_3d<f32>;
@group(0) @binding(2) var layers: texture_2d_array<u32>;
@group(0) @binding(3) var plane: texture_2d<f32>;
@group(0) @binding(4) var filtering: sampler;
@group(0) @binding(5) var<storage, read_write> results: array<vec4f>;

@compute @workgroup_size(1)
fn sample() {
    results[0] = textureLoad(line, 1, 0);
    results[1] = textureLoad(volume, vec3i(1, 0, 1), 0);
    results[2] = vec4f(textureLoad(layers, vec2i(0, 1), 1, 0));
    results[3] = textureSampleLevel(plane, filtering, vec2f(0.5, 0.5), 0.0);
    results[4] = textureSampleLevel(plane, filtering, vec2f(1.25, 0.5), 0.0);
}
"""


def test_images_have_the_dimension_of_the_shader() -> None:
    module = anyhit.Module.from_source("sample.wgsl", SAMPLE)
    volume = np.arange(2 * 2 * 2 * 4, dtype=np.float32).reshape(2, 2, 2, 4)
    layers = np.arange(2 * 2 * 1 * 4, dtype=np.uint32).reshape(2, 2, 1, 4)
    plane = np.array([[[0, 1, 2, 3], [4, 5, 6, 7]]], np.float32)
    test = anyhit.ComputeTest(module, "sample").image("line", np.array([[0, 0, 0, 0], [1, 2, 3, 4]], np.float32))
    test = test.image("volume", volume).image("layers", layers).image("plane", plane)
    test = test.buffer("results", np.zeros((5, 4), np.float32))

    def results(sampler: anyhit.Sampler) -> list[list[float]]:
        read: list[list[float]] = test.sampler("filtering", sampler).run().read_buffer("results").tolist()
        return read

    # z is the slowest axis of a volume, x the fastest: Vulkan, "Texel Coordinate Systems".
    linear = results(anyhit.Sampler(address_mode="clamp_to_edge"))
    assert linear[:3] == [[1, 2, 3, 4], volume[1, 0, 1].tolist(), layers[1, 1, 0].tolist()]
    # Half way between two texels; beyond the edge the last one, or by the mode the first.
    assert linear[3:] == [[2, 3, 4, 5], [4, 5, 6, 7]]
    repeated = results(anyhit.Sampler(mag_filter="nearest", min_filter="nearest"))
    assert repeated[4] == [0, 1, 2, 3]
    assert test.sampler("filtering", anyhit.Sampler()).run().image("volume").tolist() == volume.tolist()


def test_mistakes_in_samplers_are_named() -> None:
    wrong: Any
    for name, wrong in [("mag_filter", "cubic"), ("address_mode", ["repeat"]), ("min_lod", "1"), ("compare_op", 1)]:
        with pytest.raises(anyhit.InvalidArgument, match=name):
            anyhit.Sampler(**{name: wrong})
    assert anyhit.Sampler(min_lod=1) == anyhit.Sampler(min_lod=1.0) != anyhit.Sampler()


GLSL = """#version 460
#extension GL_EXT_ray_tracing : require
layout(set = 0, binding = 0) uniform sampler2D both;
layout(set = 0, binding = 1) buffer Result { vec4 result; };
layout(location = 0) rayPayloadInEXT float p;
void main() { result = textureLod(both, vec2(0.25, 0.5), 0); }
"""


def test_a_combined_image_sampler_is_an_image_with_a_sampler(glslang: None) -> None:
    module = anyhit.Module.from_source("both.rmiss", GLSL)
    plane = np.array([[[0, 1, 2, 3], [4, 5, 6, 7]]], np.float32)
    test = anyhit.ShaderTest(module).buffer("Result", bytes(16))
    outcome = test.image("both", plane, sampler=anyhit.Sampler(mag_filter="nearest")).run()
    assert outcome.buffer("Result") == {"result": [0, 1, 2, 3]}


MIPS = """
@group(0) @binding(0) var plane: texture_2d<f32>;
@group(0) @binding(1) var volume: texture_3d<f32>;
@group(0) @binding(2) var filtering: sampler;
@group(0) @binding(3) var<storage, read_write> results: array<vec4f>;

@compute @workgroup_size(1)
fn sample() {
    results[0] = textureLoad(plane, vec2i(0, 0), 2);
    results[1] = textureSampleLevel(plane, filtering, vec2f(0.75, 0.25), 1.0);
    results[2] = textureSampleLevel(plane, filtering, vec2f(0.75, 0.25), 0.5);
    results[3] = textureLoad(volume, vec3i(0, 0, 0), 1);
    results[4] = vec4f(f32(textureNumLevels(plane)), f32(textureNumLevels(volume)), 0.0, 0.0);
}
"""


def test_images_have_mip_levels() -> None:
    module = anyhit.Module.from_source("mips.wgsl", MIPS)
    # Vulkan, "Image Miplevel Sizing": sides are halved and rounded down, to at least 1.
    plane = [np.full((*size, 4), value, np.float32) for size, value in [((3, 4), 0), ((1, 2), 8), ((1, 1), 16)]]
    volume = [np.zeros((2, 2, 2, 4), np.float32), np.full((1, 1, 1, 4), 5, np.float32)]
    test = anyhit.ComputeTest(module, "sample").image("plane", plane[0], levels=plane[1:])
    test = test.image("volume", volume[0], levels=volume[1:]).sampler("filtering", anyhit.Sampler())
    outcome = test.buffer("results", np.zeros((5, 4), np.float32)).run()
    # Half way between the levels 0 and 1.
    expected = [[16] * 4, [8] * 4, [4] * 4, [5] * 4, [3, 2, 0, 0]]
    assert outcome.read_buffer("results").tolist() == expected
    for level in range(3):
        assert outcome.image("plane", level=level).tolist() == plane[level].tolist()
    with pytest.raises(anyhit.InvalidArgument, match="level: there is no mip level 3 of 3"):
        outcome.image("plane", level=3)
    scene = anyhit.Scene([]).image(0, 0, plane[0], levels=plane[1:])
    assert scene.read_image(0, 0, level=2).tolist() == [[[16] * 4]]


@pytest.mark.parametrize(
    ("levels", "message"),
    [
        ([np.zeros((2, 2, 4), np.float32)], r"levels\[0\]: an array of shape \(2, 2, 4\), not \(1, 2, 4\)"),
        ([np.zeros((1, 2, 4), np.float64)], r"levels\[0\]: an array of float64"),
        ([np.zeros((1, 2, 4), np.float32)] * 2, r"levels\[1\]: an array of shape \(1, 2, 4\), not \(1, 1, 4\)"),
        ([None], r"levels\[0\]"),
        (3, "levels: expected a list, found int"),
    ],
)
def test_levels_of_another_size_are_refused(levels: Any, message: str) -> None:
    test = anyhit.ComputeTest(anyhit.Module.from_source("mips.wgsl", MIPS), "sample")
    with pytest.raises(anyhit.InvalidArgument, match=message):
        test.image("plane", np.zeros((3, 4, 4), np.float32), levels=levels)
