"""What the tests share: shaders of this repository, compiled, and small ones in WGSL."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import anyhit
import pytest

pytest_plugins = ["pytester"]

REPOSITORY = Path(__file__).resolve().parents[2]
FIXTURES = REPOSITORY / "spirv-fixtures"

# The payload holds the builtins of the hit, as the shader sees them.
BUILTINS = """
enable wgpu_ray_tracing_pipeline;
enable primitive_index;

struct Payload {
    origin: vec3f,
    t: f32,
    direction: vec3f,
    primitive: u32,
    geometry: u32,
    custom_index: u32,
    kind: u32,
    seed: u32,
}

var<incoming_ray_payload> payload: Payload;

@closest_hit @incoming_payload(payload)
fn shade(
    @builtin(object_ray_origin) origin: vec3f,
    @builtin(object_ray_direction) direction: vec3f,
    @builtin(ray_t_current_max) t: f32,
    @builtin(primitive_index) primitive: u32,
    @builtin(geometry_index) geometry: u32,
    @builtin(instance_custom_data) custom_index: u32,
    @builtin(hit_kind) kind: u32,
) {
    payload.origin = origin;
    payload.t = t;
    payload.direction = direction;
    payload.primitive = primitive;
    payload.geometry = geometry;
    payload.custom_index = custom_index;
    payload.kind = kind;
    payload.seed += 1u;
}

@miss @incoming_payload(payload)
fn sky() {
    payload.t = -1.0;
    payload.seed += 100u;
}
"""


@pytest.fixture(scope="session")
def builtins() -> anyhit.Module:
    return anyhit.Module.from_source("builtins.wgsl", BUILTINS)


@pytest.fixture(scope="session")
def pipeline(builtins: anyhit.Module) -> anyhit.Pipeline:
    shade, sky = (anyhit.Program(builtins, name) for name in ("shade", "sky"))
    return anyhit.Pipeline(hit=[shade], miss=[sky])


@pytest.fixture(scope="session")
def glslang() -> None:
    """Skips a test that compiles GLSL where no compiler is installed."""
    names = ["glslang", "glslangValidator", "glslc"]
    if not os.environ.get("GLSLANG") and not any(map(shutil.which, names)):
        pytest.skip("SKIPPED: glslang is not installed")
