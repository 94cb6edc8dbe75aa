"""A closest-hit test, complete."""

from pathlib import Path

import anyhit

FOLDER = Path(__file__).resolve().parents[2] / "spirv-fixtures/pass/sphere/closest-hit"


def test_the_normal_of_a_sphere_faces_the_ray() -> None:
    module = anyhit.Module.open(FOLDER / "main.rchit.spv")
    ray = anyhit.Ray([0, 0, 4], [0, 0, -2])
    outcome = anyhit.ShaderTest(module).hit(anyhit.Hit.sphere([0, 0, 0], 0.5, ray)).run()
    assert outcome.payload["normal"] == [0, 0, 1]
    # t counts lengths of the direction: (4 - 1/2) / 2.
    assert outcome.payload["t"] == 1.75
