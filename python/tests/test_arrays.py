"""Arrays of rays, in and out."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import anyhit
import numpy as np
import pytest

# Two triangles in the plane z = 0, beside each other.
VERTICES = np.array(
    [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[2, 0, 0], [3, 0, 0], [2, 1, 0]]], np.float32
)
DOWN = np.array([0, 0, -1], np.float32)


def triangles() -> anyhit.Instance:
    return anyhit.Instance.triangles(VERTICES)


@pytest.fixture
def scene() -> anyhit.Scene:
    ball = anyhit.Instance.spheres([[10, 0, 0]], [0.5]).custom_index(7)
    return anyhit.Scene([triangles(), ball])


def test_each_ray_has_its_row(pipeline: anyhit.Pipeline, scene: anyhit.Scene) -> None:
    origins = np.array([[0.25, 0.5, 1], [2.25, 0.25, 2], [5, 5, 1], [10, 0, 4]], np.float32)
    traced = pipeline.trace(scene, origins, DOWN)
    assert len(traced) == 4
    assert traced.hit.tolist() == [True, True, False, True]
    # The planes are at z = 0; the ball's surface is at z = 1/2.
    assert traced.t.tolist() == [1, 2, np.inf, 3.5]
    none = 2**32 - 1
    assert traced.instance.tolist() == [0, 0, none, 1]
    assert traced.primitive.tolist() == [0, 1, none, 0]
    assert traced.geometry.tolist() == [0, 0, none, 0]
    assert traced.custom_index.tolist() == [0, 0, none, 7]
    # HitKindFrontFacingTriangleKHR: Vulkan, "Ray Face Culling": the front is where the ray goes
    # against the cross product of the edges.
    assert traced.kind[:2].tolist() == [0xFE, 0xFE]
    # Barycentrics of the second and the third vertex: x and y within the unit triangle.
    assert traced.attributes[:2].tolist() == [[0.25, 0.5], [0.25, 0.25]]
    assert traced.positions[[0, 1, 3]].tolist() == [[0.25, 0.5, 0], [2.25, 0.25, 0], [10, 0, 0.5]]
    assert np.isnan(traced.positions[2]).all()
    assert traced.stats["rays"] == 4
    assert (traced.stats["ClosestHitKHR"], traced.stats["MissKHR"]) == (3, 1)


def test_the_payload_is_a_structured_array(pipeline: anyhit.Pipeline, scene: anyhit.Scene) -> None:
    assert pipeline.payload_dtype is not None and pipeline.payload_dtype.names is not None
    assert pipeline.payload_dtype.names[:2] == ("origin", "t")
    payload = np.zeros(2, pipeline.payload_dtype)
    payload["seed"] = [1, 2]
    origins = np.array([[0.25, 0.25, 1], [5, 5, 1]], np.float32)
    traced = pipeline.trace(scene, origins, DOWN, payload=payload)
    assert traced.payload.dtype == pipeline.payload_dtype
    # The closest-hit shader adds 1, the miss shader 100.
    assert traced.payload["seed"].tolist() == [2, 102]
    assert traced.payload["t"].tolist() == [1, -1]
    assert traced.payload["origin"].shape == (2, 3)
    assert payload["seed"].tolist() == [1, 2]


def test_one_row_counts_for_all(pipeline: anyhit.Pipeline, scene: anyhit.Scene) -> None:
    origin = np.array([0.25, 0.25, 1], np.float32)
    directions = np.array([[0, 0, -1], [0, 0, -2], [0, 0, 1]], np.float32)
    assert pipeline.trace(scene, origin, directions).t.tolist() == [1, 0.5, np.inf]
    assert pipeline.trace(scene, origin, DOWN).t.tolist() == [1]
    t_max = np.array([0.5, 2, 2], np.float32)
    assert pipeline.trace(scene, origin, DOWN, t_max=t_max).hit.tolist() == [False, True, True]
    assert pipeline.trace(scene, origin, DOWN, t_min=2.0).hit.tolist() == [False]


def test_masks_flags_and_indices_of_records(pipeline: anyhit.Pipeline) -> None:
    scene = anyhit.Scene([triangles().mask(1)])
    origin = [0.25, 0.25, 1]
    assert not pipeline.trace(scene, origin, DOWN, cull_mask=2).hit[0]
    # CullBackFacingTrianglesKHR, CullFrontFacingTrianglesKHR
    assert pipeline.trace(scene, origin, DOWN, flags=0x10).hit[0]
    assert not pipeline.trace(scene, origin, DOWN, flags=0x20).hit[0]
    with pytest.raises(anyhit.Trap) as raised:
        pipeline.trace(scene, [[0.25, 0.25, 1], [9, 9, 1]], DOWN, miss_index=1)
    assert (raised.value.code, raised.value.ray) == ("miss_record_missing", 1)


def test_views_are_not_copied(pipeline: anyhit.Pipeline, scene: anyhit.Scene) -> None:
    origins = np.tile(np.array([[0.25, 0.25, 1]], np.float32), (1000, 1))
    origins.flags.writeable = False
    traced = pipeline.trace(scene, origins[10:20], DOWN)
    assert len(traced) == 10
    # What comes back is memory of the run: the bytes of the payloads are seen as their structs.
    assert traced.payload.base is not None
    assert np.shares_memory(traced.payload, traced.payload["t"])
    assert traced.positions.flags.c_contiguous


@pytest.mark.parametrize(
    ("origins", "message"),
    [
        (np.zeros((4, 3)), r"origins: an array of float64, not of float32: .*astype"),
        (np.zeros((4, 3), np.int32), r"origins: an array of int32, not of float32"),
        (np.zeros((4, 2), np.float32), r"origins: an array of shape \(4, 2\), not \(N, 3\)"),
        (np.zeros(4, np.float32), r"origins: an array of shape \(4,\), not \(N, 3\)"),
        (np.zeros((2, 4, 3), np.float32), r"origins: an array of shape \(2, 4, 3\)"),
        (np.zeros((8, 3), np.float32)[::2], r"not C-contiguous: `numpy.ascontiguousarray"),
        (np.zeros((3, 4), np.float32).T, r"not C-contiguous"),
        (np.zeros((4, 3), ">f4"), r"origins: an array of >f4, not of float32"),
        (["a"], r"origins: "),
    ],
)
def test_another_array_is_refused(
    pipeline: anyhit.Pipeline, scene: anyhit.Scene, origins: object, message: str
) -> None:
    with pytest.raises(anyhit.InvalidArgument, match=message):
        pipeline.trace(scene, origins, DOWN)  # type: ignore[arg-type]


def test_lengths_and_dtypes_must_agree(pipeline: anyhit.Pipeline, scene: anyhit.Scene) -> None:
    origins = np.zeros((4, 3), np.float32)
    with pytest.raises(anyhit.InvalidArgument, match="directions has 3 rows, and origins 4"):
        pipeline.trace(scene, origins, np.zeros((3, 3), np.float32))
    with pytest.raises(anyhit.InvalidArgument, match="t_max has 2 rows, and origins 4"):
        pipeline.trace(scene, origins, DOWN, t_max=np.zeros(2, np.float32))
    with pytest.raises(anyhit.InvalidArgument, match="payload: an array of float32, not of"):
        pipeline.trace(scene, origins, DOWN, payload=np.zeros(4, np.float32))
    with pytest.raises(anyhit.InvalidArgument, match="payload has 3 rows, and origins 4"):
        pipeline.trace(scene, origins, DOWN, payload=np.zeros(3, pipeline.payload_dtype))


def test_scenes_take_arrays_of_their_shapes() -> None:
    with pytest.raises(anyhit.InvalidArgument, match=r"vertices: .* not \(N, 3\) or \(N, 3, 3\)"):
        anyhit.Instance.triangles(np.zeros((4, 2), np.float32))
    with pytest.raises(anyhit.InvalidArgument, match="indices: an array of int64, not of uint32"):
        wide: Any = np.zeros((1, 3), np.int64)
        anyhit.Instance.triangles(np.zeros((4, 3), np.float32), wide)
    with pytest.raises(anyhit.InvalidScene, match="instance 0"):
        anyhit.Scene([anyhit.Instance.spheres([[0, 0, 0]], [1, 2])])
    with pytest.raises(anyhit.InvalidArgument, match="matrix: 2 rows, not 3"):
        triangles().transform(np.zeros((2, 4), np.float32))
    with pytest.raises(anyhit.InvalidArgument, match="there is no precision `half`"):
        anyhit.Scene([], "half")  # type: ignore[arg-type]


def test_indices_name_vertices(pipeline: anyhit.Pipeline) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    indices = np.array([[0, 1, 2], [3, 2, 1]], np.uint32)
    scene = anyhit.Scene([anyhit.Instance.triangles(vertices, indices)])
    traced = pipeline.trace(scene, [[0.25, 0.25, 1], [0.75, 0.75, 1]], DOWN)
    assert traced.primitive.tolist() == [0, 1]


def test_linear_swept_spheres_are_segments_or_chains(pipeline: anyhit.Pipeline) -> None:
    positions = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [4, 2, 0]], np.float32)
    radii = np.full(4, 0.25, np.float32)
    above = [[1, 0, 1], [2, 1, 1], [3, 2, 1]]
    segments = anyhit.Scene([anyhit.Instance.lss(positions, radii)])
    # Segments from (0, 0) to (2, 0) and from (2, 2) to (4, 2); between them is nothing.
    assert pipeline.trace(segments, above, DOWN).t.tolist() == [0.75, np.inf, 0.75]
    chain = anyhit.Instance.lss(positions, radii, np.array([0, 1, 2], np.uint32))
    traced = pipeline.trace(anyhit.Scene([chain]), above, DOWN)
    assert traced.primitive.tolist() == [0, 1, 2]
    # u is 1/2 in the middle of each.
    assert traced.attributes.tolist() == [[0.5, 0]] * 3


def test_geometries_and_transforms(pipeline: anyhit.Pipeline) -> None:
    balls = [anyhit.Instance.spheres([[x, 0, 0]], [0.5]) for x in (0, 5)]
    twice = np.array([[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]], np.float32)
    scene = anyhit.Scene([balls[0].and_(balls[1]).transform(twice)])
    traced = pipeline.trace(scene, [[0, 0, 3], [10, 0, 4]], DOWN, sbt_stride=0)
    assert traced.geometry.tolist() == [0, 1]
    # The balls have the radius 1 in the world.
    assert traced.t.tolist() == [2, 3]
    with pytest.raises(anyhit.InvalidScene, match="all geometries of a BLAS must have the same type"):
        anyhit.Scene([triangles().and_(balls[0])])


def test_boxes_have_intersection_shaders() -> None:
    scene = anyhit.Scene([anyhit.Instance.aabbs([[[-1, -1, -1], [1, 1, 1]]])])
    traced = anyhit.Pipeline(hit=[[]]).trace(scene, [0, 0, 4], DOWN)
    assert not traced.hit[0] and traced.payload is None


LOG = """
enable wgpu_ray_tracing_pipeline;

@group(0) @binding(0) var<storage, read_write> log: array<u32>;
var<incoming_ray_payload> ray: u32;

@closest_hit @incoming_payload(ray)
fn append() {
    log[0] += 1u;
    log[log[0]] = ray;
}
"""


def test_rays_whose_shaders_store_run_in_their_order() -> None:
    pipeline = anyhit.Pipeline(hit=[anyhit.Module.from_source("log.wgsl", LOG)])
    scene = anyhit.Scene([triangles()]).buffer(0, 0, np.zeros(3002, np.uint32))
    origins = np.full((3000, 3), [0.25, 0.25, 1], np.float32)
    traced = pipeline.trace(scene, origins, DOWN, payload=np.arange(3000, dtype=np.uint32))
    assert traced.payload.tolist() == list(range(3000))
    assert traced.scene.read_buffer(0, 0, np.uint32).tolist() == [3000, *range(3000), 0]
    assert not scene.read_buffer(0, 0, np.uint32).any()
    # Further rays go on with what the first ones stored.
    more = pipeline.trace(traced.scene, origins[:1], DOWN, payload=np.array([7], np.uint32))
    assert more.scene.read_buffer(0, 0, np.uint32)[0] == 3001


def test_no_rays_are_no_rows(pipeline: anyhit.Pipeline, scene: anyhit.Scene) -> None:
    traced = pipeline.trace(scene, np.zeros((0, 3), np.float32), DOWN)
    assert len(traced) == 0 and traced.positions.shape == (0, 3) and traced.payload.shape == (0,)


def test_threads_trace_side_by_side(pipeline: anyhit.Pipeline, scene: anyhit.Scene) -> None:
    def trace(thread: int) -> list[float]:
        origins = np.full((500, 3), [0.25, 0.25, 1 + thread], np.float32)
        return [float(t) for t in np.unique(pipeline.trace(scene, origins, DOWN).t)]

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(trace, range(8))) == [[1 + thread] for thread in range(8)]


def test_other_threads_run_meanwhile(pipeline: anyhit.Pipeline, scene: anyhit.Scene) -> None:
    origins = np.full((50_000, 3), [0.25, 0.25, 1], np.float32)
    begun, ended = threading.Event(), threading.Event()

    def trace() -> None:
        begun.set()
        pipeline.trace(scene, origins, DOWN)
        ended.set()

    thread = threading.Thread(target=trace)
    thread.start()
    begun.wait()
    ticks = 0
    while not ended.is_set():
        ticks += 1
        time.sleep(0.001)
    thread.join()
    # Had the run held the interpreter's lock, hardly one turn would fit in.
    assert ticks > 3
