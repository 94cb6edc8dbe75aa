"""Life of a process: forks, signals and threads."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any, Callable

import anyhit
import numpy as np
import pytest

MISS = """
enable wgpu_ray_tracing_pipeline;

var<incoming_ray_payload> payload: f32;

@miss @incoming_payload(payload)
fn sky() { payload = 1.0; }
"""

# Each invocation goes around for minutes.
ENDLESS = """
enable wgpu_ray_tracing_pipeline;

@group(0) @binding(0) var<storage, read_write> sums: array<u32>;

@ray_generation
fn spin(@builtin(ray_invocation_id) id: vec3u) {
    var sum = 0u;
    for (var at = 0u; at < 2000000000u; at++) { sum += at ^ sum; }
    sums[id.x] = sum;
}

@compute @workgroup_size(64)
fn turn(@builtin(global_invocation_id) id: vec3u) {
    var sum = 0u;
    for (var at = 0u; at < 2000000000u; at++) { sum += at ^ sum; }
    sums[id.x] = sum;
}
"""

SPINNING_MISS = MISS.replace(
    "payload = 1.0;", "for (var at = 0u; at < 2000000000u; at++) { payload += f32(at); }"
)

SCENE = """
version = 1
launch = [4096, 1]
[shaders]
spin = "spin.wgsl"
[pipeline]
raygen = "spin:spin"
[resources.sums]
type = "storage_buffer"
binding = 0
size = 16384
"""

needs_fork = pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="SKIPPED: no fork on this system"
)


def trace(count: int) -> None:
    pipeline = anyhit.Pipeline(miss=[anyhit.Module.from_source("sky.wgsl", MISS)])
    traced = pipeline.trace(anyhit.Scene([]), np.zeros((count, 3), np.float32), [0, 0, 1])
    assert (traced.payload == 1).all()


def build_and_stress() -> None:
    # More than 16384 primitives, which several threads sort.
    centres = np.zeros((40000, 3), np.float32)
    centres[:, 0] = np.arange(40000) * 4
    anyhit.Scene([anyhit.Instance.spheres(centres, np.ones(40000, np.float32))])
    assert anyhit.stress(1, 0, 40)["failures"] == []


def ends_in_a_child(work: Callable[[], None]) -> None:
    context: Any = multiprocessing.get_context("fork")
    child = context.Process(target=work)
    child.start()
    child.join(60)
    hangs = child.is_alive()
    if hangs:
        child.kill()
    assert not hangs and child.exitcode == 0


@needs_fork
@pytest.mark.parametrize("warm", [lambda: trace(20000), build_and_stress], ids=["rays", "build"])
@pytest.mark.parametrize("work", [lambda: trace(20000), build_and_stress], ids=["rays", "build"])
def test_a_forked_child_runs_whatever_its_parent_did(
    warm: Callable[[], None], work: Callable[[], None]
) -> None:
    # In a process of its own, so that nothing else has started the threads.
    def parent() -> None:
        warm()
        ends_in_a_child(work)

    ends_in_a_child(parent)


def endless() -> dict[str, Callable[[], object]]:
    module = anyhit.Module.from_source("spin.wgsl", ENDLESS)
    sky = anyhit.Module.from_source("sky.wgsl", SPINNING_MISS)
    scene = anyhit.Scene([]).buffer(0, 0, np.zeros(4096, np.uint32))
    launch = anyhit.Pipeline(ray_generation=anyhit.Program(module, "spin"))
    rays = anyhit.Pipeline(miss=[sky])
    compute = anyhit.ComputeTest(module, "turn").buffer(0, 0, np.zeros(4096, np.uint32))
    origins = np.zeros((4096, 3), np.float32)
    return {
        "launch on all threads": lambda: launch.launch(scene, 4096),
        "launch on one": lambda: launch.launch(scene, 1),
        "rays": lambda: rays.trace(anyhit.Scene([]), origins, [0, 0, 1]),
        "one shader": lambda: anyhit.ShaderTest(sky, "sky").run(),
        "sanitizer": lambda: anyhit.ShaderTest(sky, "sky").sanitize(),
        "dispatch": lambda: compute.run(groups=64),
        "sanitized dispatch": lambda: compute.sanitize(),
        "stress": lambda: anyhit.stress(1, 0, 2**40),
    }


@pytest.mark.skipif(sys.platform == "win32", reason="SKIPPED: signals of POSIX")
@pytest.mark.parametrize("name", list(endless()))
def test_a_signal_ends_what_runs(name: str) -> None:
    """As Ctrl-C, and as pytest-timeout: the handler raises, and does so soon."""
    work = endless()[name]
    seen: list[float] = []

    def raised(*_: object) -> None:
        seen.append(time.monotonic())
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, raised)
    sent: list[float] = []

    def send() -> None:
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.3, send)
    try:
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            work()
        ended = time.monotonic()
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)
    # Python runs the handler within 20 ms, and the shaders end within 0.1 s; a build without
    # optimisation on a machine with other work takes longer.
    assert seen and seen[0] - sent[0] < 1
    assert ended - sent[0] < 4
    # What ran is not disturbed by it: the next run is whole.
    trace(10)


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Python's handler of SIGINT, which a job in the background of a shell starts without."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_scene_is_interrupted(tmp_path: Any, interrupts: None) -> None:
    (tmp_path / "spin.wgsl").write_text(ENDLESS)
    scene = anyhit.Scene.from_text(tmp_path / "scene.toml", SCENE)
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    for work in (scene.launch, scene.sanitize):
        timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
        timer.start()
        began = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            work()
        assert time.monotonic() - began < 6


def test_the_package_is_imported_without_numpy() -> None:
    """The plugin is loaded in every run of pytest, also in those of projects without shaders."""
    code = "import sys, anyhit, anyhit.pytest_plugin; print('numpy' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "False\n"


def test_other_threads_are_not_interrupted(interrupts: None) -> None:
    """Signals are the main thread's: rays of another thread go on."""
    results: list[bool] = []
    pipeline = anyhit.Pipeline(miss=[anyhit.Module.from_source("sky.wgsl", MISS)])
    origins = np.zeros((40000, 3), np.float32)

    def rays() -> None:
        results.append(bool((pipeline.trace(anyhit.Scene([]), origins, [0, 0, 1]).payload == 1).all()))

    thread = threading.Thread(target=rays)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(10)
    thread.join()
    assert results == [True]
