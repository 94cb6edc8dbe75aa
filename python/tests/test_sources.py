"""Sources: what is compiled, and what the cache of compiled modules returns for it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import anyhit
import pytest
from conftest import FIXTURES

GLSL = """#version 460
#extension GL_EXT_ray_tracing : require
layout(location = 0) rayPayloadInEXT float p;
void main() { p = %s; }
"""
WGSL = """
enable wgpu_ray_tracing_pipeline;
var<incoming_ray_payload> p: f32;
@miss @incoming_payload(p) fn main() { p = f32(%s); }
"""
SLANG = '[shader("miss")] void main(inout float p) { p = %s; }\n'
SCENE = """
version = 1
[shaders]
s = "%s"
[pipeline]
miss = ["s"]
[geometry.g]
type = "spheres"
positions = [[0, 0, 0]]
radii = [1]
[[instance]]
geometry = "g"
"""

glslang = os.environ.get("GLSLANG") or any(map(shutil.which, ["glslang", "glslangValidator", "glslc"]))
slangc = os.environ.get("SLANGC") or shutil.which("slangc")
LANGUAGES = [
    pytest.param("a.wgsl", WGSL, id="wgsl"),
    pytest.param(
        "a.rmiss",
        GLSL,
        id="glsl",
        marks=pytest.mark.skipif(not glslang, reason="SKIPPED: glslang is not installed"),
    ),
    pytest.param(
        "a.slang",
        SLANG,
        id="slang",
        marks=pytest.mark.skipif(not slangc, reason="SKIPPED: slangc is not installed"),
    ),
]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ANYHIT_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def value(module: anyhit.Module) -> float:
    result: float = anyhit.ShaderTest(module).run().payload
    return result


@pytest.mark.parametrize(("name", "text"), LANGUAGES)
@pytest.mark.parametrize("is_absolute", [False, True])
def test_a_text_with_the_name_of_a_file_is_compiled_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, is_absolute: bool
) -> None:
    file = tmp_path / "folder" / name
    file.parent.mkdir()
    file.write_text(text % 1)
    monkeypatch.chdir(file.parent)
    shown = str(file) if is_absolute else name
    scene = anyhit.Scene.from_text("scene.toml", SCENE % shown)
    scene.set_shader_source("s", shown, text % 2)
    assert value(scene.module("s")) == 2
    scene.set_shader_source("s", shown, "garbage")
    with pytest.raises(anyhit.InvalidSource) as raised:
        scene.module("s")
    assert raised.value.file is not None and Path(raised.value.file).name == name
    # The file is as it was, and so is what the cache has of both.
    assert file.read_text() == text % 1
    assert value(anyhit.Module.open(shown)) == 1
    assert value(anyhit.Module.from_source(shown, text % 2)) == 2
    with pytest.raises(anyhit.InvalidSource):
        anyhit.Module.from_source(shown, "garbage")
    # In another process, too.
    code = (
        "import anyhit, sys\n"
        "print(anyhit.ShaderTest(anyhit.Module.from_source(*sys.argv[1:])).run().payload)"
    )
    later = subprocess.run(
        [sys.executable, "-c", code, shown, text % 2], capture_output=True, text=True, check=True
    )
    assert float(later.stdout) == 2


@pytest.mark.parametrize(("name", "text"), LANGUAGES)
def test_a_text_in_memory_stays_out_of_the_files_of_the_user(tmp_path: Path, name: str, text: str) -> None:
    file = tmp_path / name
    file.write_text("a file of the user")
    assert value(anyhit.Module.from_source(str(file), text % 3)) == 3
    assert file.read_text() == "a file of the user"


@pytest.mark.skipif(not glslang, reason="SKIPPED: glslang is not installed")
def test_an_include_that_a_macro_names_is_read_each_time(tmp_path: Path, cache: Path) -> None:
    text = (GLSL % "FIVE").replace(
        "layout", '#extension GL_GOOGLE_include_directive : require\n#define FILE "five.glsl"\n#include FILE\nlayout'
    )
    (tmp_path / "a.rmiss").write_text(text)
    for number in (5, 6):
        (tmp_path / "five.glsl").write_text(f"#define FIVE {number}\n")
        try:
            module = anyhit.Module.open(tmp_path / "a.rmiss")
        except anyhit.InvalidSource:
            # Some versions of glslang expand no macro there.
            pytest.skip("SKIPPED: this glslang includes no file that a macro names")
        assert value(module) == number


@pytest.mark.skipif(sys.platform == "win32", reason="SKIPPED: a program is a script of sh")
def test_the_slangc_of_slangtorch_is_found(tmp_path: Path) -> None:
    folder = tmp_path / "slangtorch"
    (folder / "bin").mkdir(parents=True)
    (folder / "__init__.py").write_text("raise ImportError('it is not imported')")
    tool = folder / "bin/slangc"
    tool.write_text("#!/bin/sh\necho the slangc of slangtorch >&2\nexit 1\n")
    tool.chmod(0o755)
    code = "import anyhit, os; print(os.environ.get('SLANGC')); anyhit.Module.from_source('a.slang', '')"

    def ran(**more: str) -> tuple[str, str]:
        environment = {name: value for name, value in os.environ.items() if name != "SLANGC"}
        environment |= {"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin:/bin", **more}
        ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
        return ended.stdout.strip(), ended.stderr

    if shutil.which("slangc", path="/usr/bin:/bin"):
        pytest.skip("SKIPPED: slangc is installed")
    found, errors = ran()
    assert found == str(tool) and "the slangc of slangtorch" in errors
    # What the user names comes first.
    found, errors = ran(SLANGC="/nowhere/slangc")
    assert found == "/nowhere/slangc" and "names no program" in errors


def test_the_command_says_how_to_get_the_program() -> None:
    ended = subprocess.run([sys.executable, "-m", "anyhit"], capture_output=True, text=True)
    assert ended.returncode == 1 and "cargo install" in ended.stderr and ended.stderr.count("\n") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="SKIPPED: a program is a script of sh")
@pytest.mark.parametrize("changed", [False, True])
def test_a_file_that_changes_while_it_is_compiled_is_not_kept(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch, changed: bool
) -> None:
    tool = tmp_path / "slangc"
    module = FIXTURES / "pass/sphere/closest-hit/main.rmiss.spv"
    change = "echo '// more' >> a.slang\n" if changed else ""
    tool.write_text(f'#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\ncp {module} "$2"\n{change}')
    tool.chmod(0o755)
    monkeypatch.setenv("SLANGC", str(tool))
    (tmp_path / "a.slang").write_text("// the compiler of this test does not read it\n")
    monkeypatch.chdir(tmp_path)
    opened = anyhit.Module.open("a.slang")
    assert opened.entry_points == anyhit.Module.open(module).entry_points
    # The module may be of either text: it belongs to no key.
    assert len(list(cache.iterdir()) if cache.is_dir() else []) == (0 if changed else 1)


def test_entries_of_other_versions_are_not_read(cache: Path) -> None:
    anyhit.Module.from_source("a.wgsl", WGSL % 1)
    (entry,) = cache.iterdir()
    content = entry.read_bytes()
    head = content.split(b" ")
    for older in (b"2", b"1"):
        entry.write_bytes(b" ".join([*head[:2], older, *head[3:]]))
        assert value(anyhit.Module.from_source("a.wgsl", WGSL % 1)) == 1
        # It was compiled and written again.
        assert entry.read_bytes() == content
