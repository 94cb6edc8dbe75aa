"""Arrays of other packages: DLPack, the buffer protocol, ``__array__``."""

from __future__ import annotations

import array
import ctypes
import mmap
from typing import Any, Callable

import anyhit
import numpy as np
import pytest

SHADER = """
@group(0) @binding(0) var<storage, read> numbers: array<f32>;
@group(0) @binding(1) var<storage, read_write> doubled: array<f32>;
@compute @workgroup_size(1)
fn main(@builtin(global_invocation_id) id: vec3u) { doubled[id.x] = 2.0 * numbers[id.x]; }
"""


class DlpackTensor:
    """A tensor of a CPU, which has DLPack alone."""

    def __init__(self, values: list[float]) -> None:
        self._array = np.array(values, np.float32)

    def __dlpack__(self, **keywords: Any) -> Any:
        return self._array.__dlpack__(**keywords)

    def __dlpack_device__(self) -> Any:
        return self._array.__dlpack_device__()


class OnAnotherDevice(DlpackTensor):
    """A tensor of a GPU."""

    def __dlpack_device__(self) -> Any:
        return (2, 0)

    def __dlpack__(self, **_: Any) -> Any:
        raise BufferError("the tensor is on a GPU: call `.cpu()`")


class ArrayTensor:
    """A tensor with ``__array__``."""

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return np.array([1, 2, 3], np.float32)


def doubled(numbers: Any) -> list[float]:
    test = anyhit.ComputeTest(anyhit.Module.from_source("double.wgsl", SHADER))
    found: list[float] = test.run({"numbers": numbers}, {"doubled": 3}, groups=3)["doubled"].tolist()
    return found


def mapped() -> Any:
    memory = mmap.mmap(-1, 12)
    memory.write(np.array([1, 2, 3], np.float32).tobytes())
    return memory


@pytest.mark.parametrize(
    "numbers",
    [
        DlpackTensor([1, 2, 3]),
        ArrayTensor(),
        array.array("f", [1, 2, 3]),
        (ctypes.c_float * 3)(1, 2, 3),
        memoryview(array.array("f", [1, 2, 3])),
        np.array([1, 2, 3], np.float32).data,
        mapped(),
        memoryview(np.array([1, 2, 3], np.float32).tobytes()),
        bytearray(np.array([1, 2, 3], np.float32).tobytes()),
    ],
    ids=lambda one: type(one).__name__,
)
def test_arrays_of_other_packages_are_buffers(numbers: Any) -> None:
    assert doubled(numbers) == [2, 4, 6]


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        (array.array("d", [1, 2, 3]), "f64"),
        ((ctypes.c_int * 3)(1, 2, 3), "i32"),
        (memoryview(array.array("I", [1, 2, 3])), "u32"),
        (OnAnotherDevice([1]), "data: .*GPU"),
    ],
    ids=["array.array", "ctypes", "memoryview", "GPU"],
)
def test_their_types_are_compared(numbers: Any, message: str) -> None:
    with pytest.raises(anyhit.InvalidArgument, match=message):
        doubled(numbers)


def released() -> Any:
    view = memoryview(array.array("f", [1, 2, 3]))
    view.release()
    return view


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda view: doubled(view), "data"),
        (lambda view: anyhit.DeviceBuffers().add("a", view), "data"),
        (lambda view: anyhit.Module.from_spirv(view), "spirv"),
        (lambda view: anyhit.Instance.spheres(view, 1.0), "positions"),
        (lambda view: anyhit.Ray(view, [0, 0, 1]), "origin"),
    ],
    ids=["buffer", "device buffer", "spirv", "positions", "origin"],
)
def test_an_object_that_refuses_its_memory_is_named(call: Callable[[Any], object], name: str) -> None:
    with pytest.raises(anyhit.InvalidArgument) as raised:
        call(released())
    assert raised.value.message == f"{name}: operation forbidden on released memoryview object"


def test_results_go_to_other_packages() -> None:
    scene = anyhit.Scene([anyhit.Instance.spheres(DlpackTensor([[0, 0, 0]]), array.array("f", [0.5]))])  # type: ignore[list-item, arg-type]
    test = anyhit.ComputeTest(anyhit.Module.from_source("double.wgsl", SHADER))
    found = test.run({"numbers": np.ones(3, np.float32)}, {"doubled": 3}, groups=3)["doubled"]
    assert np.from_dlpack(found).tolist() == [2, 2, 2] and found.data.format == "f"
    assert "1 instance" in repr(scene)
