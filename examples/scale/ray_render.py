"""Renders a picture on a cluster of Ray: bands of rows, each traced through the scene's own shaders.

    python ray_render.py --size 640x360 --rows 20 -o out.ppm

Each row depends on its own rays only. A band whose worker is lost is rendered again elsewhere, so
the picture has the same bits as that of one machine.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import anyhit
import numpy as np
import numpy.typing as npt
import ray

Floats = npt.NDArray[np.float32]

SCENE = Path(__file__).resolve().parents[2] / "scenes/swept-spheres.toml"

# How often a band may lose its worker.
RETRIES = 5

# The camera of that scene: where it is, what it looks at, and the tangent of half its field of view.
EYE, TARGET, HALF_HEIGHT = (0.0, 1.5, 5.0), (0.0, 0.25, 0.0), np.tan(np.radians(20))


# What a worker has loaded. (Ray sends the functions of a script by value, which a function of
# `functools.lru_cache` does not allow.)
LOADED: dict[str, tuple[anyhit.Pipeline, anyhit.Scene]] = {}


def loaded(scene: str) -> tuple[anyhit.Pipeline, anyhit.Scene]:
    """The shaders and the acceleration structure of a scene file, once for each worker."""
    if scene not in LOADED:
        LOADED[scene] = anyhit.Scene.open(scene).pipeline()
    return LOADED[scene]


def directions(width: int, height: int, first: int, end: int) -> Floats:
    """A ray through the centre of each pixel of the rows from `first` to `end`, not included."""
    forwards = np.subtract(TARGET, EYE) / np.linalg.norm(np.subtract(TARGET, EYE))
    right = np.cross(forwards, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forwards)
    x = ((np.arange(width) + 0.5) / width * 2 - 1) * HALF_HEIGHT * width / height
    y = (1 - (np.arange(first, end) + 0.5) / height * 2) * HALF_HEIGHT
    across = x[None, :, None] * right + y[:, None, None] * up + forwards
    unit: Floats = (across / np.linalg.norm(across, axis=-1, keepdims=True)).astype(np.float32)
    return unit.reshape(-1, 3)


def render_rows(scene: str, width: int, height: int, first: int, end: int) -> Floats:
    """R, G and B of the rows from `first` to `end`: (end - first, width, 3)."""
    pipeline, structure = loaded(scene)
    origin = np.array(EYE, np.float32)
    traced = pipeline.trace(structure, origin, directions(width, height, first, end), t_min=0.001)
    colour: Floats = traced.payload["colour"].reshape(end - first, width, 3)
    return colour


render_band = ray.remote(max_retries=RETRIES)(render_rows)


def run(scene: str, width: int, height: int, rows: int) -> Floats:
    """The whole picture, (height, width, 3), of bands of so many rows."""
    firsts = range(0, height, rows)
    tasks: list[Any] = [
        render_band.remote(scene, width, height, first, min(first + rows, height)) for first in firsts
    ]
    return np.concatenate(ray.get(tasks))


def write_ppm(path: Path, picture: Floats) -> None:
    """Writes a picture with the screen's gamma, 8 bits a channel."""
    height, width, _ = picture.shape
    levels = np.rint(np.clip(picture, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
    path.write_bytes(f"P6 {width} {height} 255\n".encode() + levels.tobytes())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default=str(SCENE))
    parser.add_argument("--size", default="640x360", help="WIDTHxHEIGHT")
    parser.add_argument("--rows", type=int, default=20, help="rows of one task")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    ray.init()
    write_ppm(arguments.output, run(arguments.scene, width, height, arguments.rows))


if __name__ == "__main__":
    main()
