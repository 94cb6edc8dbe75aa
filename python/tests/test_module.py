"""Modules: read, compiled, inspected."""

from __future__ import annotations

import errno
import pickle
import re
from pathlib import Path

import anyhit
import pytest
from conftest import FIXTURES, REPOSITORY

SPHERE = FIXTURES / "pass/sphere/closest-hit/main.rchit.spv"


def test_a_module_tells_what_it_declares(builtins: anyhit.Module) -> None:
    module = anyhit.Module.open(SPHERE)
    assert [(one.name, one.stage) for one in module.entry_points] == [("main", "ClosestHitKHR")]
    assert "RayTracingSpheresGeometryNV" in module.capabilities
    assert "SPV_KHR_ray_tracing" in module.extensions
    assert [one.name for one in builtins.entry_points] == ["shade", "sky"]
    assert repr(module) == "<anyhit.Module: ClosestHitKHR main>"


def test_the_wheel_has_the_version_of_the_crate() -> None:
    manifest = (REPOSITORY / "Cargo.toml").read_text("utf-8")
    version = re.search(r'^version = "(.*)"$', manifest, re.MULTILINE)
    assert version is not None and anyhit.__version__ == version[1]


def test_bytes_are_a_module(builtins: anyhit.Module) -> None:
    module = anyhit.Module.from_spirv(SPHERE.read_bytes())
    assert module.entry_points == anyhit.Module.open(SPHERE).entry_points
    with pytest.raises(anyhit.InvalidModule):
        anyhit.Module.from_spirv(b"\0" * 20)


def test_a_program_is_one_entry_point(builtins: anyhit.Module) -> None:
    assert anyhit.Program(builtins, "sky").stage == "MissKHR"
    assert anyhit.Program(builtins, "sky", "Miss").name == "sky"
    with pytest.raises(anyhit.InvalidArgument, match="there is no stage `Mis`"):
        anyhit.Program(builtins, "sky", "Mis")
    with pytest.raises(anyhit.InvalidArgument, match="2 entry points"):
        anyhit.Pipeline(miss=[builtins])


def test_a_source_that_does_not_compile_tells_its_place(tmp_path: Path) -> None:
    source = tmp_path / "broken.wgsl"
    source.write_text("@compute @workgroup_size(1)\nfn main() {\n    let x = y;\n}\n")
    with pytest.raises(anyhit.InvalidSource) as raised:
        anyhit.Module.open(source)
    assert raised.value.file is not None and raised.value.file.endswith("broken.wgsl")
    assert raised.value.line == 3
    assert isinstance(raised.value, ValueError)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(OSError) as raised:
        anyhit.Module.open(tmp_path / "nowhere.spv")
    assert isinstance(raised.value, anyhit.IoError)
    assert raised.value.errno == errno.ENOENT
    assert "nowhere.spv" in str(raised.value)


def test_exceptions_pass_between_processes(tmp_path: Path) -> None:
    with pytest.raises(anyhit.IoError) as raised:
        anyhit.Module.open(tmp_path / "nowhere.spv")
    again = pickle.loads(pickle.dumps(raised.value))
    assert type(again) is anyhit.IoError
    assert (str(again), again.kind, again.errno) == (str(raised.value), "Io", errno.ENOENT)
