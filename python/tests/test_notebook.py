"""What notebooks show: tables of rays, pictures."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import anyhit
import numpy as np
import pytest


def decoded(png: bytes) -> np.ndarray[Any, Any]:
    """The samples of a PNG file without filters, as its specification says."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    at, chunks = 8, {}
    while at < len(png):
        length, name = struct.unpack(">I4s", png[at : at + 8])
        data = png[at + 8 : at + 8 + length]
        assert struct.unpack(">I", png[at + 8 + length : at + 12 + length])[0] == zlib.crc32(name + data)
        chunks[name], at = data, at + 12 + length
    width, height, depth, colour, *rest = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    assert depth == 8 and rest == [0, 0, 0] and chunks[b"IEND"] == b""
    components = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, 1 + width * components)
    assert (rows[:, 0] == 0).all()
    return rows[:, 1:].reshape(height, width, components)


@pytest.mark.parametrize("components", [1, 2, 3, 4])
def test_a_picture_is_a_png(components: int) -> None:
    image = np.linspace(-0.25, 1.25, 2 * 3 * components, dtype=np.float32).reshape(2, 3, components)
    # PNG, "Sample depth scaling": from 0 to 1 onto 0 to 255, rounded.
    expected = np.rint(np.clip(image, 0, 1).astype(float) * 255)
    picture = anyhit.Picture(image)
    assert (decoded(picture._repr_png_()) == expected).all()
    assert repr(picture) == f"<anyhit.Picture: 3 x 2, {components} components>"
    assert np.asarray(picture) is not None and np.asarray(picture).shape == image.shape


def test_linear_light_is_encoded_as_srgb(tmp_path: Path) -> None:
    # IEC 61966-2-1: 12.92 c up to 0.0031308, else 1.055 c^(1/2.4) - 0.055. Alpha stays.
    image = np.array([[[0.002, 0.5, 1.0, 0.5]]])
    expected = [round(255 * 12.92 * 0.002), round(255 * (1.055 * 0.5 ** (1 / 2.4) - 0.055)), 255, 128]
    anyhit.Picture(image, srgb=True).save(tmp_path / "a.png")
    assert decoded((tmp_path / "a.png").read_bytes())[0, 0].tolist() == expected
    integers = np.array([[0, 255], [7, 8]], np.uint8)
    assert decoded(anyhit.Picture(integers).png)[:, :, 0].tolist() == integers.tolist()
    assert decoded(anyhit.Picture(np.array([[np.nan, np.inf]])).png).tolist() == [[[0], [255]]]


@pytest.mark.parametrize("wrong", [np.zeros(3), np.zeros((2, 2, 5)), np.zeros((0, 2, 3)), np.zeros((1, 1), complex), "a"])
def test_what_is_no_picture_is_refused(wrong: Any) -> None:
    with pytest.raises(anyhit.InvalidArgument, match="image: an array"):
        anyhit.Picture(wrong)


def test_rays_are_tables(pipeline: anyhit.Pipeline) -> None:
    html = anyhit.Ray([0, 0, 4], [0, 0, -1])._repr_html_()
    assert "<td>(0, 0, 4)</td><td>(0, 0, -1)</td><td>0</td><td>inf</td>" in html
    scene = anyhit.Scene([anyhit.Instance.spheres([[0, 0, 0]], [0.5])])
    origins = np.array([[0, 0, 4], [3, 0, 4]] * 6, np.float32)
    html = pipeline.trace(scene, origins, [0, 0, -1])._repr_html_()
    assert "<caption>12 rays, 6 hits, the first 10</caption>" in html and html.count("<tr>") == 11
    assert "<td>0</td><td>3.5</td><td>0</td><td>0</td><td>0</td><td>(0, 0, 0.5)</td>" in html
    assert "<td>1</td><td>miss</td>" in html and "<th>payload.origin</th>" in html
