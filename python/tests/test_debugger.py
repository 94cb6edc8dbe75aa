"""The debugger's prompt, and the adapter for editors."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from typing import Any

import anyhit
import numpy as np
import pytest
from anyhit import dap
from conftest import FIXTURES, REPOSITORY

DOUBLE = """
@group(0) @binding(0) var<storage, read_write> numbers: array<f32>;

@compute @workgroup_size(2)
fn double(@builtin(global_invocation_id) id: vec3u) {
    let before = numbers[id.x];
    numbers[id.x] = 2.0 * before;
}
"""


def shader_test() -> anyhit.ShaderTest:
    module = anyhit.Module.open(FIXTURES / "pass/sphere/closest-hit/main.rchit.spv")
    hit = anyhit.Hit.sphere([0, 0, 0], 0.5, anyhit.Ray([0, 0, 4], [0, 0, -1]))
    return anyhit.ShaderTest(module).hit(hit)


def answers(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], commands: str, *test: Any) -> str:
    monkeypatch.setattr(anyhit.prompt, "_surroundings", [])
    monkeypatch.setattr(sys, "stdin", io.StringIO(commands))
    anyhit.breakpoint(*test)
    return capsys.readouterr().out


def test_a_prompt_answers_until_quit(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    text = answers(monkeypatch, capsys, "print gl_HitTEXT\nnonsense\nquit\nprint 1\n", shader_test())
    # 4 - 1/2
    assert "(anyhit) print gl_HitTEXT\ngl_HitTEXT = float 3.5\n" in text
    assert "nonsense" in text and "print 1" not in text


def test_the_end_of_the_input_leaves(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert "(anyhit)" in answers(monkeypatch, capsys, "", shader_test())


def test_an_invocation_and_a_pixel_are_chosen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = anyhit.Module.from_source("double.wgsl", DOUBLE)
    test = anyhit.ComputeTest(module, "double").buffer(0, 0, np.array([1, 4], np.float32))
    for at in (1, (1,), (1, 0, 0)):
        text = answers(monkeypatch, capsys, "print gl_GlobalInvocationID\n", test, at)
        assert "gl_GlobalInvocationID = uvec3(1, 0, 0)\n" in text
    scene = anyhit.Scene.open(REPOSITORY / "shaders/pass/sphere/closest-hit/scene.toml")
    for what in (None, (0, 0)):
        assert "(anyhit) where" in answers(monkeypatch, capsys, "where\n", scene, what)
    # Neither has changed anything.
    assert test.run().read_buffer("numbers").tolist() == [2, 8]


@pytest.mark.parametrize(
    ("test", "at", "message"),
    [
        (1, None, "test: expected anyhit.ShaderTest"),
        (shader_test(), 1, "at: a ShaderTest has a single invocation"),
        (anyhit.ComputeTest(anyhit.Module.from_source("d.wgsl", DOUBLE), "double"), (0, 0, 9), "numbers|outside"),
    ],
)
def test_mistakes_are_named(monkeypatch: pytest.MonkeyPatch, test: Any, at: Any, message: str) -> None:
    monkeypatch.setattr(anyhit.prompt, "_surroundings", [])
    with pytest.raises(anyhit.InvalidArgument, match=message):
        anyhit.breakpoint(test, at)


PROMPTED = f"""
import anyhit

def test_a_hit():
    module = anyhit.Module.open({str(FIXTURES / "pass/sphere/closest-hit/main.rchit.spv")!r})
    ray = anyhit.Ray([0, 0, 4], [0, 0, -1])
    test = anyhit.ShaderTest(module).hit(anyhit.Hit.sphere([0, 0, 0], 0.5, ray))
    print("a line of the test")
    anyhit.breakpoint(test)
    assert test.run().exit == "Returned"
"""


def test_a_prompt_in_a_test_is_not_captured(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(PROMPTED)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider"]
    done = subprocess.run(command, input="print gl_HitTEXT\nquit\n", capture_output=True, text=True, cwd=pytester.path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "gl_HitTEXT = float 3.5" in done.stdout and "a line of the test" not in done.stdout
    pytest.importorskip("xdist")
    spread = subprocess.run([*command, "-n", "1"], capture_output=True, text=True, cwd=pytester.path)
    assert "run pytest without `-n`" in spread.stdout


def test_an_exception_of_a_callback_ends_the_session() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/payload/structs/main.rchit.spv")
    hit = anyhit.Hit.sphere([0, 0, 0], 0.5, anyhit.Ray([0, 0, 4], [0, 0, -1]))

    def fails(_: anyhit.TraceCall) -> None:
        raise LookupError("no light")

    test = anyhit.ShaderTest(module).hit(hit).on_trace(fails)
    for run in (test.run, test.sanitize, lambda: test.debug("continue")):
        with pytest.raises(LookupError, match="no light"):
            run()
    # Each run begins anew.
    answered = anyhit.ShaderTest(module).hit(hit).on_trace(lambda _: {"counts": [0, 1]})
    assert answered.sanitize() == [] and answered.run().traces and answered.debug("continue")


def framed(message: dict[str, Any]) -> bytes:
    text = json.dumps(message).encode()
    return b"Content-Length: %d\r\n\r\n" % len(text) + text


def test_an_editor_is_served() -> None:
    # The Debug Adapter Protocol: each request has a response of its number.
    requests = [
        {"seq": 1, "type": "request", "command": "initialize", "arguments": {"adapterID": "anyhit"}},
        {"seq": 2, "type": "request", "command": "disconnect", "arguments": {}},
    ]
    done = subprocess.run(
        [sys.executable, "-m", "anyhit.dap"], input=b"".join(map(framed, requests)), capture_output=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    bodies = [part[part.index(b"{") :] for part in done.stdout.split(b"Content-Length: ")[1:]]
    responses = {found["request_seq"]: found for found in map(json.loads, bodies) if found["type"] == "response"}
    assert responses[1]["success"] and responses[1]["body"]["supportsStepBack"]
    assert responses[2]["success"]


def test_a_port_that_is_none_is_refused() -> None:
    with pytest.raises(anyhit.InvalidArgument, match="port"):
        dap.serve(70_000)
