from os import PathLike
from typing import (
    Any,
    Callable,
    Iterable,
    Literal,
    Mapping,
    Optional,
    Sequence,
    Union,
    final,
    overload,
)

import numpy as np
import numpy.typing as npt
from typing_extensions import TypeAlias

_Path: TypeAlias = Union[str, "PathLike[str]"]
_Int: TypeAlias = Union[int, np.integer[Any]]
_Number: TypeAlias = Union[float, np.floating[Any], np.integer[Any]]
# Arrays that are used without a copy have their dtype; a few numbers may have any.
_Float: TypeAlias = Union[npt.NDArray[np.float32], Sequence[Any], _Number]
_Index: TypeAlias = Union[npt.NDArray[np.uint32], Sequence[Any]]
_Numbers: TypeAlias = Union[Sequence[_Number], npt.NDArray[Any]]
_Points: TypeAlias = Union[Sequence[_Numbers], npt.NDArray[Any]]
_Ints: TypeAlias = Union[Sequence[_Int], npt.NDArray[np.integer[Any]]]
_Bytes: TypeAlias = Union[bytes, bytearray, memoryview]
_Data: TypeAlias = Union[npt.NDArray[Any], _Bytes]
_Members: TypeAlias = Mapping[str, Any]
_Buffer: TypeAlias = Union[_Data, _Members, list[Any], tuple[Any, ...]]
_Texels: TypeAlias = Union[
    npt.NDArray[np.float32],
    npt.NDArray[np.uint32],
    npt.NDArray[np.int32],
    npt.NDArray[np.uint64],
    npt.NDArray[np.int64],
    Sequence[Any],
]
# A binding of a dict: a name, the binding of set 0, or (set, binding).
_Key: TypeAlias = Union[str, int, tuple[int, int]]
_Place: TypeAlias = Union[_Int, str]
_Constants: TypeAlias = Mapping[int, Union[bool, _Number]]
_Filter: TypeAlias = Literal["nearest", "linear"]
_AddressMode: TypeAlias = Literal[
    "repeat", "mirrored_repeat", "clamp_to_edge", "clamp_to_border", "mirror_clamp_to_edge"
]
_Shader: TypeAlias = Union["Program", "Module"]

__version__: str
__all__ = [
    "__version__",
    "ComputeOutcome",
    "ComputeTest",
    "EntryPoint",
    "Finished",
    "Hit",
    "Instance",
    "Launched",
    "LoadedScene",
    "Module",
    "ModuleBinding",
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
    "stress",
]

@final
class EntryPoint:
    @property
    def name(self) -> str: ...
    @property
    def stage(self) -> str: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class ModuleBinding:
    @property
    def name(self) -> str: ...
    @property
    def set(self) -> int: ...
    @property
    def binding(self) -> int: ...
    @property
    def type(self) -> str: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Sampler:
    def __new__(
        cls,
        *,
        mag_filter: Optional[_Filter] = None,
        min_filter: Optional[_Filter] = None,
        mipmap_mode: Optional[_Filter] = None,
        address_mode: Optional[Union[_AddressMode, Sequence[_AddressMode]]] = None,
        border_color: Optional[Literal["transparent_black", "opaque_black", "opaque_white"]] = None,
        compare_op: Optional[
            Literal[
                "never",
                "less",
                "equal",
                "less_or_equal",
                "greater",
                "not_equal",
                "greater_or_equal",
                "always",
            ]
        ] = None,
        min_lod: Optional[_Number] = None,
        max_lod: Optional[_Number] = None,
        lod_bias: Optional[_Number] = None,
        max_anisotropy: Optional[_Number] = None,
        unnormalized_coordinates: Optional[bool] = None,
    ) -> Sampler: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class Module:
    @staticmethod
    def open(path: _Path) -> Module: ...
    @staticmethod
    def from_spirv(spirv: _Bytes) -> Module: ...
    @staticmethod
    def from_source(name: str, text: str) -> Module: ...
    @property
    def entry_points(self) -> list[EntryPoint]: ...
    @property
    def capabilities(self) -> list[str]: ...
    @property
    def extensions(self) -> list[str]: ...
    @property
    def instruction_sets(self) -> list[str]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def bindings(self) -> list[ModuleBinding]: ...
    def buffer_dtype(
        self, set: _Place, binding: Optional[_Int] = None, *, count: _Int = 0
    ) -> np.dtype[Any]: ...

@final
class Program:
    def __new__(
        cls,
        module: Module,
        entry: str = "main",
        stage: Optional[str] = None,
        *,
        specialization: Optional[_Constants] = None,
    ) -> Program: ...
    @property
    def name(self) -> str: ...
    @property
    def stage(self) -> str: ...

@final
class Ray:
    def __new__(
        cls, origin: _Numbers, direction: _Numbers, t_min: _Number = 0.0, t_max: _Number = ...
    ) -> Ray: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __getnewargs__(self) -> tuple[list[float], list[float], float, float]: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def direction(self) -> list[float]: ...
    @property
    def t_min(self) -> float: ...
    @property
    def t_max(self) -> float: ...

@final
class Instance:
    @staticmethod
    def triangles(vertices: _Float, indices: Optional[_Index] = None) -> Instance: ...
    @staticmethod
    def spheres(positions: _Float, radii: _Float) -> Instance: ...
    @staticmethod
    def lss(
        positions: _Float, radii: _Float, indices: Optional[_Index] = None, end_caps: bool = True
    ) -> Instance: ...
    @staticmethod
    def aabbs(boxes: _Float) -> Instance: ...
    def and_(self, other: Instance) -> Instance: ...
    def opaque(self) -> Instance: ...
    def geometry_flags(self, flags: _Int) -> Instance: ...
    def transform(self, matrix: _Float) -> Instance: ...
    def translate(self, by: _Numbers) -> Instance: ...
    def custom_index(self, custom_index: _Int) -> Instance: ...
    def mask(self, mask: _Int) -> Instance: ...
    def sbt_offset(self, sbt_offset: _Int) -> Instance: ...
    def flags(self, flags: _Int) -> Instance: ...

@final
class Hit:
    def __new__(
        cls,
        instance: Instance,
        ray: Ray,
        *,
        ray_flags: _Int = 0,
        cull_mask: _Int = 255,
        time: _Number = 0.0,
    ) -> Hit: ...
    @staticmethod
    def sphere(position: _Numbers, radius: _Number, ray: Ray) -> Hit: ...
    @staticmethod
    def lss(positions: _Points, radii: _Numbers, ray: Ray) -> Hit: ...
    @staticmethod
    def triangle(vertices: _Points, ray: Ray) -> Hit: ...
    @staticmethod
    def aabb(minimum: _Numbers, maximum: _Numbers, ray: Ray) -> Hit: ...

@final
class Scene:
    def __new__(
        cls,
        instances: Iterable[Instance],
        precision: Literal["exact", "double", "float"] = "exact",
    ) -> Scene: ...
    @staticmethod
    def open(path: _Path) -> LoadedScene: ...
    @staticmethod
    def from_text(path: _Path, text: str) -> LoadedScene: ...
    def bind(self, set: _Place, binding: Optional[_Int] = None) -> Scene: ...
    @overload
    def buffer(
        self, set: _Int, binding: _Int, data: _Buffer, module: Optional[Module] = None
    ) -> Scene: ...
    @overload
    def buffer(
        self, set: str, binding: _Buffer, data: None = None, module: Optional[Module] = None
    ) -> Scene: ...
    @overload
    def buffer(
        self, set: str, binding: None = None, *, data: _Buffer, module: Optional[Module] = None
    ) -> Scene: ...
    @overload
    def image(
        self,
        set: _Int,
        binding: _Int,
        texels: _Texels,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> Scene: ...
    @overload
    def image(
        self,
        set: str,
        binding: _Texels,
        texels: None = None,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> Scene: ...
    @overload
    def image(
        self,
        set: str,
        binding: None = None,
        *,
        texels: _Texels,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> Scene: ...
    @overload
    def sampler(self, set: _Int, binding: _Int, sampler: Sampler) -> Scene: ...
    @overload
    def sampler(self, set: str, binding: Sampler, sampler: None = None) -> Scene: ...
    @overload
    def sampler(self, set: str, binding: None = None, *, sampler: Sampler) -> Scene: ...
    @overload
    def read_buffer(
        self, set: _Int, binding: _Int, dtype: Optional[npt.DTypeLike] = None
    ) -> npt.NDArray[Any]: ...
    @overload
    def read_buffer(
        self, set: str, binding: Optional[npt.DTypeLike] = None, dtype: None = None
    ) -> npt.NDArray[Any]: ...
    @overload
    def read_buffer(
        self, set: str, binding: None = None, *, dtype: npt.DTypeLike
    ) -> npt.NDArray[Any]: ...
    def read_image(self, set: _Place, binding: Optional[_Int] = None) -> npt.NDArray[Any]: ...
    def push_constants(self, module: Module, values: _Members) -> Scene: ...

@final
class Pipeline:
    def __new__(
        cls,
        *,
        ray_generation: Optional[_Shader] = None,
        hit: Iterable[Union[_Shader, Iterable[_Shader]]] = ...,
        miss: Iterable[_Shader] = ...,
        callable: Iterable[_Shader] = ...,
        max_recursion: Optional[_Int] = None,
        fuel: Optional[_Int] = None,
    ) -> Pipeline: ...
    @property
    def payload_dtype(self) -> Optional[np.dtype[Any]]: ...
    def trace(
        self,
        scene: Scene,
        origins: _Float,
        directions: _Float,
        *,
        t_min: Optional[_Float] = None,
        t_max: Optional[_Float] = None,
        flags: _Int = 0,
        cull_mask: _Int = 255,
        sbt_offset: _Int = 0,
        sbt_stride: _Int = 1,
        miss_index: _Int = 0,
        time: Optional[_Float] = None,
        payload: Optional[npt.NDArray[Any]] = None,
    ) -> Traced: ...
    def launch(self, scene: Scene, width: _Int, height: _Int = 1, depth: _Int = 1) -> Launched: ...

@final
class Traced:
    @property
    def hit(self) -> npt.NDArray[np.bool_]: ...
    @property
    def t(self) -> npt.NDArray[np.float32]: ...
    @property
    def instance(self) -> npt.NDArray[np.uint32]: ...
    @property
    def custom_index(self) -> npt.NDArray[np.uint32]: ...
    @property
    def geometry(self) -> npt.NDArray[np.uint32]: ...
    @property
    def primitive(self) -> npt.NDArray[np.uint32]: ...
    @property
    def kind(self) -> npt.NDArray[np.uint32]: ...
    @property
    def attributes(self) -> npt.NDArray[np.float32]: ...
    @property
    def positions(self) -> npt.NDArray[np.float32]: ...
    @property
    def payload(self) -> Any: ...
    @property
    def printed(self) -> list[list[str]]: ...
    @property
    def stats(self) -> dict[str, int]: ...
    @property
    def scene(self) -> Scene: ...
    def __len__(self) -> int: ...

@final
class Launched:
    @property
    def stats(self) -> dict[str, int]: ...
    @property
    def printed(self) -> list[tuple[list[int], str]]: ...
    @property
    def scene(self) -> Scene: ...
    def image(self, set: _Place, binding: Optional[_Int] = None) -> npt.NDArray[Any]: ...
    def buffer(self, set: _Place, binding: Optional[_Int] = None) -> Any: ...
    @overload
    def read_buffer(
        self, set: _Int, binding: _Int, dtype: Optional[npt.DTypeLike] = None
    ) -> npt.NDArray[Any]: ...
    @overload
    def read_buffer(
        self, set: str, binding: Optional[npt.DTypeLike] = None, dtype: None = None
    ) -> npt.NDArray[Any]: ...
    @overload
    def read_buffer(
        self, set: str, binding: None = None, *, dtype: npt.DTypeLike
    ) -> npt.NDArray[Any]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class LoadedScene:
    def launch(
        self, width: Optional[_Int] = None, height: Optional[_Int] = None
    ) -> SceneOutcome: ...
    def pipeline(self) -> tuple[Pipeline, Scene]: ...
    def module(self, name: str) -> Module: ...
    def read_all(self) -> None: ...
    def set_buffer(self, name: str, data: _Data) -> None: ...
    def set_push_constants(self, data: _Data) -> None: ...
    def set_transform(self, instance: _Int, matrix: _Float) -> None: ...
    def set_shader_source(self, name: str, file_name: str, text: str) -> None: ...
    def set_shader_spirv(self, name: str, spirv: _Bytes) -> None: ...
    def sanitize(self) -> list[str]: ...
    def many_seeds(self, seeds: _Int) -> list[str]: ...
    def explain(self, what: Union[tuple[int, int], str]) -> str: ...

@final
class SceneOutcome:
    @property
    def stats(self) -> dict[str, int]: ...
    @property
    def printed(self) -> list[tuple[list[int], str]]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def image(self, name: str) -> npt.NDArray[Any]: ...
    def buffer(self, name: str) -> Any: ...
    def read_buffer(self, name: str, dtype: Optional[npt.DTypeLike] = None) -> npt.NDArray[Any]: ...

@final
class ShaderTest:
    def __new__(
        cls,
        module: Module,
        entry: str = "main",
        stage: Optional[str] = None,
        *,
        specialization: Optional[_Constants] = None,
    ) -> ShaderTest: ...
    def hit(self, hit: Hit) -> ShaderTest: ...
    def ray(self, ray: Ray) -> ShaderTest: ...
    def launch(self, id: _Ints, size: _Ints) -> ShaderTest: ...
    def builtin(self, name: str, value: Any) -> ShaderTest: ...
    def payload(self, values: Any) -> ShaderTest: ...
    def attributes(self, attributes: _Numbers) -> ShaderTest: ...
    def shader_record(self, values: _Members) -> ShaderTest: ...
    def push_constants(self, values: _Members) -> ShaderTest: ...
    @overload
    def buffer(self, set: _Int, binding: _Int, data: _Buffer) -> ShaderTest: ...
    @overload
    def buffer(self, set: str, binding: _Buffer, data: None = None) -> ShaderTest: ...
    @overload
    def buffer(self, set: str, binding: None = None, *, data: _Buffer) -> ShaderTest: ...
    @overload
    def image(
        self,
        set: _Int,
        binding: _Int,
        texels: _Texels,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> ShaderTest: ...
    @overload
    def image(
        self,
        set: str,
        binding: _Texels,
        texels: None = None,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> ShaderTest: ...
    @overload
    def image(
        self,
        set: str,
        binding: None = None,
        *,
        texels: _Texels,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> ShaderTest: ...
    @overload
    def sampler(self, set: _Int, binding: _Int, sampler: Sampler) -> ShaderTest: ...
    @overload
    def sampler(self, set: str, binding: Sampler, sampler: None = None) -> ShaderTest: ...
    @overload
    def sampler(self, set: str, binding: None = None, *, sampler: Sampler) -> ShaderTest: ...
    def fuel(self, instructions: _Int) -> ShaderTest: ...
    def on_trace(self, callback: Callable[[TraceCall], Optional[Any]]) -> ShaderTest: ...
    def on_call(self, callback: Callable[[int, Any], Optional[Any]]) -> ShaderTest: ...
    def reject_reports(self) -> ShaderTest: ...
    def run(self) -> ShaderOutcome: ...
    def sanitize(self) -> list[str]: ...

@final
class ShaderOutcome:
    @property
    def exit(self) -> Literal["Returned", "Ignored", "Terminated"]: ...
    @property
    def payload(self) -> Any: ...
    @property
    def attributes(self) -> Any: ...
    @property
    def reports(self) -> list[dict[str, Any]]: ...
    @property
    def traces(self) -> list[TraceCall]: ...
    @property
    def printed(self) -> list[str]: ...
    def image(self, set: _Place, binding: Optional[_Int] = None) -> npt.NDArray[Any]: ...
    def buffer(self, set: _Place, binding: Optional[_Int] = None) -> Any: ...
    @overload
    def read_buffer(
        self, set: _Int, binding: _Int, dtype: Optional[npt.DTypeLike] = None
    ) -> npt.NDArray[Any]: ...
    @overload
    def read_buffer(
        self, set: str, binding: Optional[npt.DTypeLike] = None, dtype: None = None
    ) -> npt.NDArray[Any]: ...
    @overload
    def read_buffer(
        self, set: str, binding: None = None, *, dtype: npt.DTypeLike
    ) -> npt.NDArray[Any]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def explain(self) -> str: ...

@final
class ComputeTest:
    def __new__(
        cls, module: Module, entry: str = "main", *, specialization: Optional[_Constants] = None
    ) -> ComputeTest: ...
    def workgroups(self, x: _Int, y: _Int = 1, z: _Int = 1) -> ComputeTest: ...
    @overload
    def scene(self, set: _Int, binding: _Int, scene: Scene) -> ComputeTest: ...
    @overload
    def scene(self, set: str, binding: Scene, scene: None = None) -> ComputeTest: ...
    @overload
    def scene(self, set: str, binding: None = None, *, scene: Scene) -> ComputeTest: ...
    @overload
    def buffer(self, set: _Int, binding: _Int, data: _Buffer) -> ComputeTest: ...
    @overload
    def buffer(self, set: str, binding: _Buffer, data: None = None) -> ComputeTest: ...
    @overload
    def buffer(self, set: str, binding: None = None, *, data: _Buffer) -> ComputeTest: ...
    @overload
    def image(
        self,
        set: _Int,
        binding: _Int,
        texels: _Texels,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> ComputeTest: ...
    @overload
    def image(
        self,
        set: str,
        binding: _Texels,
        texels: None = None,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> ComputeTest: ...
    @overload
    def image(
        self,
        set: str,
        binding: None = None,
        *,
        texels: _Texels,
        format: Optional[str] = None,
        sampler: Optional[Sampler] = None,
    ) -> ComputeTest: ...
    @overload
    def sampler(self, set: _Int, binding: _Int, sampler: Sampler) -> ComputeTest: ...
    @overload
    def sampler(self, set: str, binding: Sampler, sampler: None = None) -> ComputeTest: ...
    @overload
    def sampler(self, set: str, binding: None = None, *, sampler: Sampler) -> ComputeTest: ...
    def push_constants(self, values: _Members) -> ComputeTest: ...
    def fuel(self, instructions: _Int) -> ComputeTest: ...
    def subgroup_size(self, size: _Int) -> ComputeTest: ...
    @overload
    def run(
        self,
        inputs: Optional[Mapping[Any, _Buffer]] = None,
        outputs: None = None,
        *,
        groups: Optional[Union[_Int, _Ints]] = None,
    ) -> ComputeOutcome: ...
    @overload
    def run(
        self,
        inputs: Optional[Mapping[Any, _Buffer]],
        outputs: Union[Sequence[_Key], Mapping[Any, Union[_Buffer, int]]],
        *,
        groups: Optional[Union[_Int, _Ints]] = None,
    ) -> dict[Any, npt.NDArray[Any]]: ...
    @overload
    def run(
        self,
        inputs: Optional[Mapping[Any, _Buffer]] = None,
        *,
        outputs: Union[Sequence[_Key], Mapping[Any, Union[_Buffer, int]]],
        groups: Optional[Union[_Int, _Ints]] = None,
    ) -> dict[Any, npt.NDArray[Any]]: ...
    def sanitize(self) -> list[str]: ...

@final
class ComputeOutcome:
    @property
    def stats(self) -> dict[str, int]: ...
    @property
    def printed(self) -> list[tuple[list[int], str]]: ...
    def image(self, set: _Place, binding: Optional[_Int] = None) -> npt.NDArray[Any]: ...
    def buffer(self, set: _Place, binding: Optional[_Int] = None) -> Any: ...
    @overload
    def read_buffer(
        self, set: _Int, binding: _Int, dtype: Optional[npt.DTypeLike] = None
    ) -> npt.NDArray[Any]: ...
    @overload
    def read_buffer(
        self, set: str, binding: Optional[npt.DTypeLike] = None, dtype: None = None
    ) -> npt.NDArray[Any]: ...
    @overload
    def read_buffer(
        self, set: str, binding: None = None, *, dtype: npt.DTypeLike
    ) -> npt.NDArray[Any]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class TraceCall:
    @property
    def number(self) -> int: ...
    @property
    def ray(self) -> Ray: ...
    @property
    def flags(self) -> int: ...
    @property
    def cull_mask(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def sbt_offset(self) -> int: ...
    @property
    def sbt_stride(self) -> int: ...
    @property
    def miss_index(self) -> int: ...
    @property
    def given(self) -> Any: ...
    @property
    def payload(self) -> Any: ...

@final
class Suite:
    def __new__(cls, path: _Path) -> Suite: ...
    @property
    def names(self) -> list[str]: ...
    def run(
        self,
        at: _Int,
        *,
        sanitize: bool = False,
        many_seeds: Optional[_Int] = None,
        perturb: Optional[_Int] = None,
        all_widths: bool = False,
        explanation: bool = True,
        pictures: Optional[_Path] = None,
    ) -> Finished: ...

@final
class Finished:
    @property
    def outcome(self) -> Literal["passed", "failed", "error", "known failure"]: ...
    @property
    def text(self) -> str: ...
    @property
    def reason(self) -> str: ...
    @property
    def place(self) -> Optional[tuple[str, int]]: ...

def stress(seed: _Int, first: _Int, end: _Int) -> dict[str, Any]: ...
