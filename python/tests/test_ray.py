"""The examples for Ray, on a local cluster of two workers of which one is killed in the middle."""

from __future__ import annotations

import importlib
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import anyhit
import numpy as np
import pytest
from conftest import REPOSITORY

ray: Any = pytest.importorskip("ray", reason="SKIPPED: test_ray: Ray is not installed")

EXAMPLES = REPOSITORY / "examples/scale"


@pytest.fixture(scope="module")
def cluster() -> Iterator[None]:
    path = os.pathsep.join([str(EXAMPLES), os.environ.get("PYTHONPATH", "")])
    ray.init(
        num_cpus=2,
        include_dashboard=False,
        log_to_driver=False,
        runtime_env={"env_vars": {"PYTHONPATH": path}},
    )
    yield
    ray.shutdown()


@pytest.fixture
def example(cluster: None, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Any]:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module


def parents(pid: int) -> Iterator[int]:
    """The process's parent, its parent, and so on."""
    while pid > 1:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        pid = int(fields[1])
        yield pid


def workers(task: str) -> list[int]:
    """The processes beneath this one that run a task; Ray names them by it."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            title = (entry / "cmdline").read_bytes().split(b"\0")[0].decode()
            if title == f"ray::{task}" and os.getpid() in parents(int(entry.name)):
                found.append(int(entry.name))
        except (OSError, ValueError):
            continue
    return found


class Killer(threading.Thread):
    """Kills the first worker that runs a task, once it has run for a moment."""

    def __init__(self, task: str) -> None:
        super().__init__(daemon=True)
        self._task = task
        self.killed = 0

    def run(self) -> None:
        deadline = time.monotonic() + 60
        while not self.killed and time.monotonic() < deadline:
            time.sleep(0.05)
            for worker in workers(self._task)[:1]:
                os.kill(worker, signal.SIGKILL)
                self.killed = worker


needs_proc = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="SKIPPED: test_ray: workers are found in /proc"
)


@pytest.mark.parametrize(
    ("script", "fewer", "said"),
    [
        ("ray_stress.py", ["--cases", "60", "--share", "20"], "60 cases"),
        ("ray_render.py", ["--size", "32x18", "--rows", "9"], ""),
    ],
)
def test_a_command_of_the_page_runs(script: str, fewer: list[str], said: str, tmp_path: Path) -> None:
    """The last of several options of a name counts."""
    page = (REPOSITORY / "docs/python.md").read_text("utf-8")
    start = f"python examples/scale/{script} "
    (line,) = [line for line in page.splitlines() if line.startswith(start)]
    command = [sys.executable, str(EXAMPLES / script), *shlex.split(line.removeprefix(start)), *fewer]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    assert said in done.stdout
    if "-o" in command:
        assert (tmp_path / "out.ppm").read_bytes().startswith(b"P6 32 18 255\n")


@needs_proc
def test_stress_loses_nothing_with_a_worker(example: Callable[[str], Any]) -> None:
    ray_stress = example("ray_stress")
    killer = Killer("judge")
    killer.start()
    report = ray_stress.run(seed=3, cases=3000, share=250)
    killer.join()
    assert killer.killed
    assert report == anyhit.stress(3, 0, 3000)
    assert report["failures"] == []


@needs_proc
def test_a_picture_loses_nothing_with_a_worker(example: Callable[[str], Any], tmp_path: Path) -> None:
    ray_render = example("ray_render")
    scene, size = str(ray_render.SCENE), (96, 54)
    killer = Killer("render_rows")
    killer.start()
    picture = ray_render.run(scene, *size, rows=9)
    killer.join()
    assert killer.killed
    assert picture.shape == (54, 96, 3)
    assert picture.tobytes() == ray_render.render_rows(scene, *size, 0, 54).tobytes()
    # The launch of the scene has the same camera, and its ray generation shader the screen's gamma.
    launched = anyhit.Scene.open(scene).launch(*size).image("picture")[..., :3]
    assert np.isclose(np.clip(picture, 0, 1) ** (1 / 2.2), launched, atol=2e-3).mean() > 0.99
    ray_render.write_ppm(tmp_path / "out.ppm", picture)
    assert (tmp_path / "out.ppm").stat().st_size == len(b"P6 96 54 255\n") + 96 * 54 * 3
