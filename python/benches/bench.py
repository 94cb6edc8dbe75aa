"""Times what Python adds to the crate: ``python benches/bench.py``. Each figure is the least of several
runs.

``--check`` fails where reading a buffer by names takes more than twice as long as NumPy takes for the
same lists.
"""

from __future__ import annotations

import sys
import time
from typing import Any, Callable

import anyhit
import numpy as np

HIT = """
enable wgpu_ray_tracing_pipeline;
struct Payload { t: f32 }
var<incoming_ray_payload> payload: Payload;
@closest_hit @incoming_payload(payload)
fn main(@builtin(ray_t_current_max) t: f32) { payload.t = t; }
"""
COMPUTE = """
@group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
@compute @workgroup_size(1) fn main() { numbers[0] = 1.0; }
"""


def least(run: Callable[[], Any], runs: int, calls: int = 1) -> float:
    """The seconds of a call."""
    found = float("inf")
    for _ in range(runs):
        begin = time.perf_counter()
        for _ in range(calls):
            run()
        found = min(found, (time.perf_counter() - begin) / calls)
    return found


def main() -> int:
    module = anyhit.Module.from_source("hit.wgsl", HIT)
    ray = anyhit.Ray([0, 0, 4], [0, 0, -1])
    ball = anyhit.Instance.spheres([[0, 0, 0]], [0.5])
    test = anyhit.ShaderTest(module).hit(anyhit.Hit(ball, ray))
    pipeline = anyhit.Pipeline(hit=[module])
    triangle = anyhit.Scene([anyhit.Instance.triangles([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]])])
    origins = np.zeros((1_000_000, 3), np.float32)
    origins[:, 2] = 4
    numbers = np.arange(4_000_000, dtype=np.float32)
    compute = anyhit.ComputeTest(anyhit.Module.from_source("compute.wgsl", COMPUTE))
    outcome = compute.buffer("numbers", numbers).run()

    figures = {
        "ShaderTest.run": least(test.run, 20, 2000),
        "ShaderTest with a hit, and its payload": least(
            lambda: anyhit.ShaderTest(module).hit(anyhit.Hit(ball, ray)).run().payload, 10, 500
        ),
        "Pipeline.trace of 1,000,000 rays": least(lambda: pipeline.trace(triangle, origins, [0, 0, -1]), 3),
        "read_buffer of 4,000,000 floats": least(lambda: outcome.read_buffer("numbers"), 5),
        "buffer of 4,000,000 floats": least(lambda: outcome.buffer("numbers"), 5),
        "tolist of 4,000,000 floats": least(numbers.tolist, 5),
        "ComputeTest.run with 4,000,000 floats": least(
            lambda: compute.run({"numbers": numbers}, ["numbers"]), 5
        ),
    }
    for name, seconds in figures.items():
        print(f"{name:45} {seconds * 1e6:14,.1f} us")
    is_slow = figures["buffer of 4,000,000 floats"] > 2 * figures["tolist of 4,000,000 floats"]
    return int("--check" in sys.argv and is_slow)


if __name__ == "__main__":
    sys.exit(main())
