"""Launches: of pipelines that are built, and of scene files."""

from __future__ import annotations

from pathlib import Path

import anyhit
import numpy as np
import pytest
from conftest import FIXTURES, REPOSITORY

SPHERE = REPOSITORY / "shaders/pass/sphere/closest-hit/scene.toml"

# Writes the launch index of each pixel, and whether its ray meets something.
CAMERA = """
enable wgpu_ray_tracing_pipeline;

struct Settings { scale: f32 }

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var picture: texture_storage_2d<rgba32float, write>;
@group(0) @binding(2) var<uniform> settings: Settings;

var<ray_payload> payload: f32;
var<incoming_ray_payload> incoming: f32;

@ray_generation
fn camera(@builtin(ray_invocation_id) id: vec3u) {
    payload = 0.0;
    let at = vec3f(vec2f(id.xy) + 0.5, 4.0);
    traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 100.0, at, vec3f(0.0, 0.0, -1.0)), &payload);
    textureStore(picture, id.xy, vec4f(vec2f(id.xy), payload * settings.scale, 1.0));
}

@closest_hit @incoming_payload(incoming)
fn white() {
    incoming = 1.0;
}

@miss @incoming_payload(incoming)
fn black() {
    incoming = 0.0;
}
"""


ADD = """
@group(0) @binding(0) var<storage, read_write> numbers: array<u32, 2>;

@compute @workgroup_size(2)
fn add(@builtin(local_invocation_index) at: u32) {
    numbers[at] += 1u;
}
"""

ADD_SCENE = """version = 1
[shaders]
add = "add.wgsl"
[[dispatch]]
shader = "add:add"
[resources.numbers]
type = "storage_buffer"
binding = 0
data = { u32 = [1, 2] }
"""


def test_a_launch_fills_an_image() -> None:
    module = anyhit.Module.from_source("camera.wgsl", CAMERA)
    camera, white, black = (anyhit.Program(module, name) for name in ("camera", "white", "black"))
    pipeline = anyhit.Pipeline(ray_generation=camera, hit=[white], miss=[black])
    # A square that covers the pixels with x < 2.
    square = np.array([[[0, 0, 0], [2, 0, 0], [0, 9, 0]], [[2, 9, 0], [0, 9, 0], [2, 0, 0]]], np.float32)
    scene = anyhit.Scene([anyhit.Instance.triangles(square)]).bind(0, 0)
    scene = scene.image(0, 1, np.zeros((3, 4, 4), np.float32)).buffer(0, 2, {"scale": 8}, module)
    launched = pipeline.launch(scene, 4, 3)
    picture = launched.image(0, 1)
    assert picture.shape == (3, 4, 4) and picture.dtype == np.float32
    y, x = np.mgrid[0:3, 0:4]
    assert (picture[..., 0] == x).all() and (picture[..., 1] == y).all()
    assert (picture[..., 2] == np.where(x < 2, 8, 0)).all()
    assert launched.stats["rays"] == 12
    # As an array, the buffer is what its bytes are.
    again = pipeline.launch(scene.buffer(0, 2, np.array([2], np.float32)), 4, 3)
    assert again.image(0, 1)[0, 0, 2] == 2
    assert again.read_buffer(0, 2, np.float32).tolist() == [2]


COUNT = """
enable wgpu_ray_tracing_pipeline;

@group(0) @binding(0) var<storage, read_write> counts: array<u32, 2>;

@ray_generation
fn count(@builtin(ray_invocation_id) id: vec3u) {
    counts[id.x] += 1u + id.x;
}
"""


def test_a_launch_leaves_the_scene_and_returns_another() -> None:
    pipeline = anyhit.Pipeline(ray_generation=anyhit.Module.from_source("count.wgsl", COUNT))
    scene = anyhit.Scene([]).buffer(0, 0, np.zeros(2, np.uint32))
    first, again = (pipeline.launch(scene, 2) for _ in range(2))
    second = pipeline.launch(first.scene, 2)
    counts = [one.read_buffer(0, 0, np.uint32).tolist() for one in (scene, first, again, second)]
    assert counts == [[0, 0], [1, 2], [1, 2], [2, 4]]


def test_a_trap_of_a_launch_has_its_index() -> None:
    module = anyhit.Module.open(FIXTURES / "fail/memory/array-index/main.rgen.spv")
    scene = anyhit.Scene([]).buffer(0, 1, np.full(6, -1, np.float32))
    with pytest.raises(anyhit.Trap) as raised:
        anyhit.Pipeline(ray_generation=module).launch(scene, 6)
    # The array has four elements: 4 is the first index that is outside.
    assert (raised.value.code, raised.value.launch_id) == ("index_out_of_bounds", (4, 0, 0))
    assert raised.value.line == 11
    assert raised.value.stack[0]["entry_point"] == "main"


def test_a_scene_file_is_launched() -> None:
    scene = anyhit.Scene.open(SPHERE)
    outcome = scene.launch()
    # Four of sixteen rays meet the sphere.
    assert (outcome.stats["ClosestHitKHR"], outcome.stats["MissKHR"]) == (4, 12)
    outputs = outcome.read_buffer("outputs", np.float32).reshape(16, 8)
    # Its first and its sixth ray: a miss, and a hit at z = sqrt(1/8) of a sphere of radius 1/2.
    assert outputs[0].tolist() == [0, 0, 0, -1, -0.75, -0.75, 0, 0]
    assert outputs[5, :4].tolist() == pytest.approx([-0.5, -0.5, 0.5**0.5, 4 - 0.125**0.5])
    assert scene.launch(2, 2).stats["RayGenerationKHR"] == 4
    assert "pixel (0, 0)" in scene.explain((0, 0))
    assert "the centre" in scene.explain("the centre")


def test_rays_go_through_a_scene_file() -> None:
    pipeline, scene = anyhit.Scene.open(SPHERE).pipeline()
    traced = pipeline.trace(scene, [[0, 0, 4], [1, 1, 4]], [0, 0, -1])
    assert traced.t.tolist() == [3.5, np.inf]
    assert traced.payload["normal"][0].tolist() == [0, 0, 1]


def test_a_scene_file_is_changed() -> None:
    scene = anyhit.Scene.open(REPOSITORY / "shaders/pass/ray-query/compute/scene.toml")
    found = scene.launch().read_buffer("outputs", np.uint32).tolist()
    assert found == [54, 38, 54, 38]
    far = np.eye(3, 4, dtype=np.float32)
    far[0, 3] = 100
    scene.set_transform(0, far)
    assert scene.launch().read_buffer("outputs", np.uint32).tolist() == [0] * 4
    with pytest.raises(anyhit.InvalidArgument, match="no instance 9"):
        scene.set_transform(9, far)


def test_a_file_that_nothing_reads_is_not_opened(tmp_path: Path) -> None:
    (tmp_path / "add.wgsl").write_text(ADD)
    (tmp_path / "broken.png").write_text("no picture")
    unread = '[resources.map]\ntype = "sampled_image"\nbinding = 9\nfile = "broken.png"\n'
    scene = anyhit.Scene.from_text(tmp_path / "scene.toml", ADD_SCENE + unread)
    assert scene.launch().read_buffer("numbers", np.uint32).tolist() == [2, 3]
    with pytest.raises(anyhit.Error, match="broken.png"):
        scene.read_all()


def test_a_text_is_a_scene(tmp_path: Path) -> None:
    (tmp_path / "add.wgsl").write_text(ADD)
    scene = anyhit.Scene.from_text(tmp_path / "scene.toml", ADD_SCENE)
    assert scene.launch().read_buffer("numbers", np.uint32).tolist() == [2, 3]
    scene.set_buffer("numbers", np.array([10, 20], np.uint32))
    assert scene.launch().read_buffer("numbers", np.uint32).tolist() == [11, 21]
    scene.set_shader_source("add", "other.wgsl", ADD.replace("+= 1u", "+= 5u"))
    assert scene.launch().read_buffer("numbers", np.uint32).tolist() == [15, 25]
    with pytest.raises(anyhit.InvalidArgument, match="did you mean `numbers`"):
        scene.set_buffer("number", b"")


def test_a_mistake_in_a_scene_has_its_line(tmp_path: Path) -> None:
    with pytest.raises(anyhit.Error) as raised:
        anyhit.Scene.from_text(tmp_path / "scene.toml", ADD_SCENE.replace("storage_buffer", "store"))
    assert raised.value.file is not None and raised.value.file.endswith("scene.toml")
    assert raised.value.line == 7


def test_the_sanitizer_and_many_seeds() -> None:
    with pytest.raises(anyhit.Finding):
        anyhit.Scene.open(REPOSITORY / "shaders/sanitize/pow-domain/scene.toml").sanitize()
    with pytest.raises(anyhit.Finding):
        anyhit.Scene.open(REPOSITORY / "shaders/many-seeds/anyhit-order/scene.toml").many_seeds(8)
    assert anyhit.Scene.open(SPHERE).sanitize() == []


def test_stress_ranges_add_up() -> None:
    whole, first, second = (anyhit.stress(1, *ends) for ends in ((0, 40), (0, 15), (15, 40)))
    assert whole["failures"] == [] and whole["cases"] == 40 and whole["rays"] > 40
    for count in ("cases", "lines", "rays", "hits", "culled", "trees", "packets"):
        assert whole[count] == first[count] + second[count]
    with pytest.raises(anyhit.InvalidArgument, match="beyond the last"):
        anyhit.stress(1, 3, 2)
