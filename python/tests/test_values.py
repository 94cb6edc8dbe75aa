"""Values are equal, hashed, shown, copied and pickled as Python's own are."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import anyhit
import numpy as np
import pytest
from conftest import FIXTURES

SHADER = """
@group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
@compute @workgroup_size(1) fn main() { numbers[0] = 1.0; }
"""


def module(text: str = SHADER) -> anyhit.Module:
    return anyhit.Module.from_source("values.wgsl", text)


VALUES: list[Any] = [
    lambda: anyhit.Ray([0, 1, 2], [0, 0, -1], t_max=5),
    lambda: anyhit.Sampler(mag_filter="nearest", address_mode=["repeat", "clamp_to_edge", "repeat"], max_lod=2.5),
    lambda: anyhit.Sampler(compare_op="less", border_color="opaque_white", unnormalized_coordinates=True),
    lambda: module().entry_points[0],
    lambda: module().bindings[0],
]


@pytest.mark.parametrize("make", VALUES)
def test_values_are_equal_hashed_shown_copied_and_pickled(make: Any) -> None:
    one, other = make(), make()
    assert one == other and hash(one) == hash(other) and {one, other} == {one}
    assert one != 1 and one != "a" and not one == None  # noqa: E711
    # `repr` evaluates to an equal value.
    assert eval(repr(one), vars(anyhit) | {"inf": float("inf")}) == one
    for again in [copy.copy(one), copy.deepcopy(one), *(pickle.loads(pickle.dumps(one, at)) for at in range(2, 6))]:
        assert again == one and type(again) is type(one)
    assert copy.deepcopy([one, one]) == [one, one]


def test_other_values_differ() -> None:
    assert anyhit.Sampler(max_lod=1) != anyhit.Sampler(max_lod=2)
    assert hash(anyhit.Sampler(min_lod=-0.0)) == hash(anyhit.Sampler(min_lod=0.0))
    assert anyhit.Ray([0, 0, 0], [0, 0, 1]) != anyhit.Ray([0, 0, 0], [0, 0, 2])
    assert repr(anyhit.Sampler()) == "Sampler()"


def test_modules_are_equal_by_their_words() -> None:
    one, other = module(), module(SHADER.replace("1.0", "2.0"))
    assert one == module() and hash(one) == hash(module()) and one != other
    again = pickle.loads(pickle.dumps(one))
    assert again == one and copy.deepcopy(one) is one
    found = anyhit.ComputeTest(again).run(outputs={"numbers": 1})
    assert found["numbers"].tolist() == [1]
    opened = anyhit.Module.open(FIXTURES / "pass/sphere/closest-hit/main.rchit.spv")
    assert opened == anyhit.Module.from_spirv((FIXTURES / "pass/sphere/closest-hit/main.rchit.spv").read_bytes())


def test_what_never_changes_is_its_own_copy() -> None:
    ray = anyhit.Ray([0, 0, 4], [0, 0, -1])
    ball = anyhit.Instance.spheres([[0, 0, 0]], [0.5])
    test = anyhit.ComputeTest(module()).buffer(0, 0, np.zeros(1, np.float32))
    for one in [ball, anyhit.Hit(ball, ray), anyhit.Scene([ball]), test, test.run(), anyhit.Program(module(), "main")]:
        assert copy.copy(one) is one and copy.deepcopy(one) is one
        assert repr(one).startswith(("<anyhit.", "Instance", "Hit"))


def test_a_loaded_scene_is_copied() -> None:
    path = FIXTURES.parent / "shaders/pass/sphere/closest-hit/scene.toml"
    scene = anyhit.Scene.open(path)
    other = copy.deepcopy(scene)
    moved = scene.transform(0)
    moved[0, 3] = 100
    other.set_transform(0, moved)
    assert scene.transform(0)[0, 3] != 100 and other.transform(0)[0, 3] == 100
    assert "scene.toml" in repr(scene)
