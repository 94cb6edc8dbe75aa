"""Values of Python as a shader's: each is taken exactly, or refused with a reason.

What a value becomes is computed here in fractions, by docs/testing.md, "Value conversions".
"""

from __future__ import annotations

import math
import random
import struct
from fractions import Fraction
from pathlib import Path
from typing import Any, Callable, Optional, Union

import anyhit
import numpy as np
import pytest
from conftest import FIXTURES

Exact = Union[bool, int, Fraction, float, None]
CONVERSIONS = FIXTURES / "pass/harness/conversions"
TRIANGLE = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
DOWN = anyhit.Ray([0, 0, 4], [0, 0, -1])

# Members of the block at binding 0 of types.comp: kind, and bits; of a float also those of its
# significand.
MEMBERS = {
    "u": ("uint", 32),
    "i": ("int", 32),
    "u8": ("uint", 8),
    "i16": ("int", 16),
    "i64": ("int", 64),
    "u64": ("uint", 64),
    "f": ("float", 32),
    "h": ("float", 16),
    "d": ("float", 64),
    # A bool of the source.
    "flag": ("uint", 32),
}
SIGNIFICANDS = {16: 10, 32: 23, 64: 52}


@pytest.fixture(scope="module")
def types() -> anyhit.Module:
    return anyhit.Module.open(CONVERSIONS / "types.comp.spv")


@pytest.fixture(scope="module")
def payloads() -> anyhit.Module:
    return anyhit.Module.open(CONVERSIONS / "payload.rchit.spv")


def payload_test(module: anyhit.Module) -> anyhit.ShaderTest:
    test = anyhit.ShaderTest(module).hit(anyhit.Hit.triangle(TRIANGLE, DOWN))
    test = test.buffer(0, 1, np.zeros(8, np.uint32)).shader_record({"id": 2})
    return test.push_constants({"count": 5})


def nearest(value: Fraction, width: int) -> Optional[Fraction]:
    """The nearest number of a format, ties to even; None where it overflows or vanishes."""
    if value == 0:
        return value
    significand = SIGNIFICANDS[width]
    greatest = 2 ** (width - significand - 2) - 1
    size = abs(value)
    binade = size.numerator.bit_length() - size.denominator.bit_length()
    if Fraction(2) ** binade > size:
        binade -= 1
    step = Fraction(2) ** (max(binade, 1 - greatest) - significand)
    rounded: Fraction = round(size / step) * step
    if rounded == 0 or rounded >= Fraction(2) ** (greatest + 1):
        return None
    return rounded if value > 0 else -rounded


def exact(value: Any) -> Exact:
    """A number of Python or of numpy as what it is; None for anything else."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        number = float(value)
        return Fraction(number) if math.isfinite(number) else number
    return None


def rule(given: Exact, kind: str, width: int, is_buffer: bool) -> Exact:
    """What a value becomes in a type; None where it is refused."""
    if kind == "bool":
        return given if isinstance(given, bool) else None
    if isinstance(given, bool):
        return int(given) if is_buffer and kind != "float" and width == 32 else None
    if kind == "float":
        if isinstance(given, float):
            return given
        if given is None:
            return None
        rounded = nearest(Fraction(given), width)
        # An integer is taken where the float type has it.
        return None if isinstance(given, int) and rounded != given else rounded
    least, end = (-(2 ** (width - 1)), 2 ** (width - 1)) if kind == "int" else (0, 2**width)
    return given if isinstance(given, int) and least <= given < end else None


def same(found: Any, wanted: Exact) -> bool:
    if isinstance(wanted, bool) or isinstance(wanted, int):
        return type(found) is type(wanted) and found == wanted
    if isinstance(wanted, float):
        return found == wanted or (math.isnan(wanted) and math.isnan(found))
    return isinstance(found, float) and math.isfinite(found) and Fraction(found) == wanted


def scalars(seed: int, count: int) -> list[Any]:
    """Numbers of every kind, many of them near the ends of ranges and near ties."""
    draw = random.Random(seed)
    integers: list[Any] = [np.uint8, np.int8, np.uint16, np.int16, np.uint32, np.int32, np.uint64, np.int64]
    out: list[Any] = [True, False, np.bool_(True), math.nan, math.inf, -math.inf, 0, 0.0, 2**200, -(2**70)]
    out += [65519.99, 65520.0, 1e300, 1e-300, 5e-324, 2**24 + 1, 2049, np.float16(1.5), "1", None, [], [1], b"1"]
    out += [np.longdouble(1), np.complex64(1), np.datetime64(7, "ns"), np.array(3), np.array(0.5), {1}, np.str_("1")]
    while len(out) < count:
        whole = (1 << draw.choice([0, 7, 8, 15, 16, 24, 31, 32, 53, 63, 64, 100])) + draw.randint(-2, 2)
        whole *= draw.choice([1, -1])
        dtype = draw.choice(integers)
        fits = np.iinfo(dtype).min <= whole <= np.iinfo(dtype).max
        power = 2.0 ** draw.choice([-1074, -150, -149, -126, -25, -24, -14, 0, 10, 15, 16, 127, 128, 1023])
        edge = power * draw.choice([1.0, 1.5, 1 + 2**-11, 1 + 3 * 2**-11, 1 + 2**-24, 1 + 2**-52, 2 - 2**-24])
        bits = struct.unpack("<d", struct.pack("<Q", draw.getrandbits(64)))[0]
        narrow = np.uint32(draw.getrandbits(32)).view(np.float32)
        half = np.uint16(draw.getrandbits(16)).view(np.float16)
        out += [whole, edge, -edge, bits, narrow, half, np.float64(edge)] + ([dtype(whole)] if fits else [])
    return out


def check(
    store: Callable[[Any], Any], value: Any, kind: str, width: int, is_buffer: bool, place: str
) -> None:
    shown = f"{value!r} ({type(value).__name__}) for {place}"
    # An array without dimensions is its number.
    given = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    # What has more digits than a float of Python is no number of a shader.
    wider: tuple[Any, ...] = (np.longdouble, np.complexfloating, np.datetime64)
    is_known = not isinstance(given, wider)
    wanted = rule(exact(given) if is_known else None, kind, width, is_buffer)
    # An integer beyond 127 bits is none.
    if isinstance(given, int) and not -(2**127) <= given < 2**127:
        wanted = None
    try:
        found = store(value)
    except anyhit.InvalidArgument as error:
        assert wanted is None, f"{shown}: {error}"
        assert str(error).startswith("error: ")
    else:
        assert wanted is not None and same(found, wanted), f"{shown} became {found!r}, not {wanted!r}"


def test_members_of_buffers_take_what_the_rule_allows(types: anyhit.Module, tmp_path: Path) -> None:
    # Without a launch a scene's buffer is what was set.
    sizes = {"uint": "u", "int": "i", "float": "f"}
    offsets = {"u": 0, "i": 4, "f": 8, "h": 28, "d": 32, "i64": 40, "u64": 48, "u8": 200, "i16": 202, "flag": 304}
    empty = anyhit.Scene([anyhit.Instance.triangles([TRIANGLE])])
    for at, value in enumerate(scalars(1, 400)):
        for name, (kind, width) in MEMBERS.items():
            if at >= 40 and (at + width + len(name)) % 3:
                continue

            def store(given: Any, name: str = name, kind: str = kind, width: int = width) -> Any:
                scene = empty.buffer(0, 0, {name: given}, module=types)
                content = scene.read_buffer(0, 0).tobytes()
                dtype = f"<{sizes[kind]}{width // 8}"
                return np.frombuffer(content, dtype, 1, offsets[name])[0].item()

            check(store, value, kind, width, True, name)


def test_payloads_take_what_the_rule_allows(payloads: anyhit.Module) -> None:
    test = payload_test(payloads)
    members = {"flag": ("bool", 32), "h": ("float", 16)}
    for value in scalars(2, 150):
        for name, (kind, width) in members.items():
            check(lambda given: test.payload({name: given}).run().payload[name], value, kind, width, False, name)


def test_builtins_and_answers_take_what_the_rule_allows(builtins: anyhit.Module) -> None:
    test = anyhit.ShaderTest(builtins, "shade").hit(anyhit.Hit.triangle(TRIANGLE, DOWN))
    structs = anyhit.Module.open(FIXTURES / "pass/payload/structs/main.rchit.spv")
    traced = anyhit.ShaderTest(structs).hit(anyhit.Hit.sphere([0, 0, 0], 0.5, DOWN))

    def answered(given: Any) -> Any:
        outcome = traced.on_trace(lambda trace: {"counts": [0, given]}).run()
        return outcome.traces[0].payload["counts"][1]

    for value in scalars(3, 120):
        check(lambda given: test.builtin("RayTmax", given).run().payload["t"], value, "float", 32, False, "t")
        store = lambda given: test.builtin("HitKindKHR", given).run().payload["kind"]  # noqa: E731
        if not (isinstance(value, (int, np.integer)) and value < 0):
            check(store, value, "uint", 32, False, "HitKindKHR")
        check(answered, value, "int", 32, False, "counts")


def test_numbers_of_geometry_take_what_the_rule_allows() -> None:
    for value in scalars(4, 200):
        check(lambda given: anyhit.Ray([given, 0, 0], [0, 0, 1]).origin[0], value, "float", 32, False, "origin")
        check(lambda given: anyhit.Ray([0, 0, 0], [0, 0, 1], 0, given).t_max, value, "float", 32, False, "t_max")

    image = anyhit.Scene([anyhit.Instance.triangles([TRIANGLE])])
    for value in scalars(5, 100):

        def texel(given: Any) -> Any:
            texels: Any = [[[given, 0, 0, 0]]]
            return image.image(0, 0, texels, "rgba32f").read_image(0, 0)[0, 0, 0].item()

        check(texel, value, "float", 32, False, "texel")


@pytest.mark.parametrize("dtype", [*"?bBhHiIlLqQefdgFDO", "S1", "U1", ">f4", ">u4", "m8[s]"])
def test_arrays_of_every_dtype_are_those_of_the_shader(payloads: anyhit.Module, dtype: str) -> None:
    """A buffer of uint takes integers of 32 bits that it has, zeros of any scalar, and bytes."""
    shader = payload_test(payloads)
    kind = np.dtype(dtype)
    zeros = np.zeros(32 // kind.itemsize if kind.itemsize <= 32 else 1, kind)
    ones = np.ones_like(zeros) if kind.kind not in "SUmO" else zeros
    is_number = kind.kind in "iuf" and kind.itemsize <= 8 and kind.isnative
    is_bytes = kind == np.uint8
    is_own = kind.kind in "iu" and kind.itemsize == 4
    for array, is_fine in [(zeros, is_number), (ones, is_number and (is_bytes or is_own))]:
        if is_fine:
            shader.buffer(0, 1, array).run()
        else:
            with pytest.raises(anyhit.InvalidArgument):
                shader.buffer(0, 1, array).run()
    if is_own and kind.kind == "i":
        with pytest.raises(anyhit.InvalidArgument, match="-1"):
            shader.buffer(0, 1, -ones).run()


class TestSiblings:
    """What is refused through the other entrances is refused here."""

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ({"u": -1}, "`u` of struct Block: -1 is out of the range of uint"),
            ({"u": 2**32}, "out of the range of uint, 0 to 4294967295"),
            ({"u8": -1}, "out of the range of uint8_t"),
            ({"i16": 40000}, "out of the range of int16_t"),
            ({"i64": 2**64 - 1}, "out of the range of int64_t"),
            ({"f": 1e300}, "1e300 is out of the range of float"),
            ({"h": 1e6}, "out of the range of float16_t"),
            ({"f": 2**24 + 1}, "16777217 is not exactly representable as float: the nearest value is 16777216"),
            ({"cm": [[1, 2], [3, 4], [5, 6]]}, r"which requires \[\[float; 3\]; 2\]"),
            ({"v3": [1, 2]}, r"not \[integer; 2\]"),
            ({"v3": [1, 2, 3, 4]}, r"not \[integer; 4\]"),
            ({"v3": "123"}, "expected a number, a list of numbers or a dict, found str"),
            ({"v3": {1, 2, 3}}, "found set"),
            ({"u": np.longdouble(1)}, "has no equivalent in a shader"),
            ({"u": 1.0}, "1.0 is a float, not uint"),
            ({"f": True}, "true is a bool, not float"),
            ({"u8": True}, "true is a bool, not uint8_t"),
            ({"inner": [{"c": 1}]}, "`inner` has 2 elements, found 1"),
            ({"powr": 1}, "powr"),
        ],
    )
    def test_members(self, types: anyhit.Module, values: dict[str, Any], message: str) -> None:
        scene = anyhit.Scene([anyhit.Instance.triangles([TRIANGLE])])
        with pytest.raises(anyhit.InvalidArgument, match=message):
            scene.buffer(0, 0, values, module=types)

    def test_lists_that_hold_themselves_end(self, types: anyhit.Module) -> None:
        endless: list[Any] = []
        endless.append(endless)
        scene = anyhit.Scene([anyhit.Instance.triangles([TRIANGLE])])
        with pytest.raises(anyhit.InvalidArgument, match="nested more than 32 deep"):
            scene.buffer(0, 0, {"u": endless}, module=types)

    def test_members_that_fit(self, types: anyhit.Module) -> None:
        scene = anyhit.Scene([anyhit.Instance.triangles([TRIANGLE])])
        values = {"cm": np.arange(6, dtype=np.float16).reshape(2, 3), "arr": range(6), "bb": [True, False]}
        content = scene.buffer(0, 0, values, module=types).read_buffer(0, 0, np.float32)
        # `cm` has two columns of 16 bytes, at 144; `arr` follows `inner` at 272, `bb` at 296.
        assert content[36:44].tolist() == [0, 1, 2, 0, 3, 4, 5, 0]
        assert content[68:74].tolist() == [0, 1, 2, 3, 4, 5]
        assert content.view(np.uint32)[74:76].tolist() == [1, 0]

    def test_payloads(self, payloads: anyhit.Module) -> None:
        test = payload_test(payloads)
        for values in [{"hits": -1}, {"hits": True}, {"flag": 1}, {"c": [1, 2]}, {"m": [[0, 0]] * 3}, {"d": "1"}]:
            with pytest.raises(anyhit.InvalidArgument):
                test.payload(values).run()
        assert test.payload({"m": np.ones((2, 3)), "c": (1, 2, 3)}).run().payload["m"] == [[1.0] * 3] * 2

    def test_builtins(self) -> None:
        test = anyhit.ShaderTest(anyhit.Module.open(CONVERSIONS / "object_to_world.rchit.spv"))
        rows = [[1, 0, 0, 10], [0, 1, 0, 20], [0, 0, 1, 30]]
        with pytest.raises(anyhit.InvalidArgument):
            test.builtin("ObjectToWorldKHR", rows).run()
        columns = np.array(rows, np.float32).T
        assert test.builtin("ObjectToWorldKHR", columns).run().payload[3] == [10, 20, 30]

    def test_rows_have_the_stride_of_the_shader(self, tmp_path: Path) -> None:
        text = (
            "version = 1\npush_constants = { zeros = 16 }\n[shaders.types]\npath = '" + str(CONVERSIONS / "types.comp.spv") + "'\n"
            "[[dispatch]]\nshader = 'types'\n"
            "[resources.block]\ntype = 'storage_buffer'\nbinding = 0\nsize = 352\n"
            "[resources.vectors]\ntype = 'storage_buffer'\nbinding = 1\nsize = 48\n"
            "[resources.uniforms]\ntype = 'uniform_buffer'\nbinding = 2\nsize = 96\n"
            "[resources.outputs]\ntype = 'storage_buffer'\nbinding = 3\nsize = 64\n"
        )
        path = tmp_path / "scene.toml"
        wrong: Any
        for wrong, message in [
            (np.ones((4, 3), np.float32), "elements are 12 bytes apart, but 16 in the shader"),
            (np.ones((3, 2), np.float64), "f64"),
            (np.ones((3, 4), np.uint32), "u32"),
        ]:
            scene = anyhit.Scene.from_text(path, text)
            with pytest.raises(anyhit.InvalidArgument, match=message):
                scene.set_buffer("vectors", wrong)
                scene.launch()
        scene = anyhit.Scene.from_text(path, text)
        scene.set_buffer("vectors", np.array([[1, 2, 3, 0], [4, 5, 6, 0], [7, 8, 9, 0]], np.float32))
        scene.set_push_constants(np.array([7, 0, 0, 0], np.uint32))
        # vectors.v.length(), the bits of v[1].x, and the push constant.
        outputs = scene.launch().read_buffer("outputs", np.uint32)
        assert outputs[[3, 4, 6]].tolist() == [3, int(np.float32(4).view(np.uint32)), 7]
        for constants in [np.array([7, 0.25, 0, 0], np.float32), np.zeros(100, np.uint32)]:
            scene = anyhit.Scene.from_text(path, text)
            with pytest.raises(anyhit.InvalidArgument):
                scene.set_push_constants(constants)
                scene.launch()

    def test_lists_of_geometry(self) -> None:
        wrong: Any
        indices: Any
        for wrong in [[[1e300, 0, 0]], [[True, 0, 0]], [["1", 0, 0]], [[2**24 + 1, 0, 0]], [[0, 0, 0], [0]]]:
            with pytest.raises(anyhit.InvalidArgument):
                anyhit.Instance.spheres(wrong, 1.0)
        for indices in [[-1, 0, 1], [0.5, 0, 1], [2**32, 0, 1], [True, 0, 1], [math.nan, 0, 1]]:
            with pytest.raises(anyhit.InvalidArgument):
                anyhit.Instance.triangles(TRIANGLE, indices)
