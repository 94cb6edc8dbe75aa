"""Runs ray-tracing shaders (SPIR-V) on the CPU: one shader in a unit test, arrays of rays through a
scene, whole launches.

Arrays are numpy's: what is many goes in and out as float32 and uint32, without copies where
possible. Errors are exceptions (``anyhit.Error``), a shader that misbehaves raises ``anyhit.Trap``.
"""

import os as _os
import shutil as _shutil
from importlib.util import find_spec as _find_spec

from ._anyhit import (
    ComputeOutcome,
    ComputeTest,
    Coverage,
    DeviceBuffers,
    EntryPoint,
    ExecuteCall,
    Finished,
    Hit,
    Instance,
    Launched,
    LoadedScene,
    Module,
    ModuleBinding,
    Pipeline,
    Program,
    Ray,
    Sampler,
    Scene,
    SceneOutcome,
    ShaderOutcome,
    ShaderTest,
    Suite,
    TraceCall,
    Traced,
    __version__,
    stress,
)
from .errors import (
    Error,
    Expectation,
    Finding,
    InvalidArgument,
    InvalidImage,
    InvalidMesh,
    InvalidModule,
    InvalidRecording,
    InvalidScene,
    InvalidSource,
    InvalidType,
    IoError,
    Trap,
    UnsupportedFile,
    UnsupportedModule,
    UnsupportedTool,
)
from .picture import Picture
from .prompt import breakpoint


def _find_slangc() -> None:
    """Lets Slang sources be compiled by the slangc of an installed slangtorch, unless another one is
    on PATH or named by the environment variable SLANGC."""
    if _os.environ.get("SLANGC") or _shutil.which("slangc"):
        return
    spec = _find_spec("slangtorch")
    for folder in spec.submodule_search_locations or [] if spec else []:
        found = _shutil.which("slangc", path=_os.path.join(folder, "bin"))
        if found:
            _os.environ["SLANGC"] = found
            return


_find_slangc()

__all__ = [
    "ComputeOutcome",
    "ComputeTest",
    "Coverage",
    "DeviceBuffers",
    "EntryPoint",
    "Error",
    "ExecuteCall",
    "Expectation",
    "Finding",
    "Finished",
    "Hit",
    "Instance",
    "InvalidArgument",
    "InvalidImage",
    "InvalidMesh",
    "InvalidModule",
    "InvalidRecording",
    "InvalidScene",
    "InvalidSource",
    "InvalidType",
    "IoError",
    "Launched",
    "LoadedScene",
    "Module",
    "ModuleBinding",
    "Picture",
    "Pipeline",
    "Program",
    "Ray",
    "Sampler",
    "Scene",
    "SceneOutcome",
    "ShaderOutcome",
    "ShaderTest",
    "Suite",
    "TraceCall",
    "Traced",
    "Trap",
    "UnsupportedFile",
    "UnsupportedModule",
    "UnsupportedTool",
    "__version__",
    "breakpoint",
    "stress",
]
