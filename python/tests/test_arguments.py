"""Arguments of calls: mistakes name them in Python's words, and no object crashes the interpreter."""

from __future__ import annotations

import copy
import inspect
import itertools
import math
import pickle
import random
import re
import subprocess
import sys
import warnings
from typing import Any, Callable

import anyhit
import numpy as np
import pytest
from conftest import FIXTURES

DOWN = anyhit.Ray([0, 0, 4], [0, 0, -1])
TRIANGLE = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]

COMPUTE = """
override scale: f32 = 2.0;
@id(7) override more: u32 = 1u;
struct Push { factor: f32 }
@group(0) @binding(0) var<storage, read> numbers: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;
@compute @workgroup_size(2)
fn main(@builtin(global_invocation_id) id: vec3u) { results[id.x] = numbers[id.x] * scale + f32(more); }
"""


ORIGINS = np.zeros((1, 3), np.float32)
SCENE = anyhit.Scene([])
# What a type checker refuses, too.
untyped: Any = anyhit
Mistake = Callable[[Any, Any], object]
MISTAKES: dict[str, tuple[Mistake, str]] = {
    "dtype": (
        lambda pipeline, _: pipeline.trace(SCENE, ORIGINS.astype(float), [0, 0, 1]),
        "origins: an array of float64, not of float32",
    ),
    "extension": (lambda *_: anyhit.Module.from_source("a", "x"), "end the name with one of these extensions"),
    "miss index": (
        lambda pipeline, _: pipeline.trace(SCENE, ORIGINS, [0, 0, 1], miss_index=3),
        "anyhit.Pipeline's miss",
    ),
    "text in a list": (
        lambda *_: untyped.Pipeline(hit=["a.rchit"]),
        r"hit\[0\]: expected anyhit.Program, anyhit.Module or a list of them, found str",
    ),
    "no list": (
        lambda _, module: anyhit.Pipeline(miss=module),
        r"miss: expected a list, found Module: write `miss=\[...\]`",
    ),
    "mask": (lambda *_: anyhit.Instance.spheres(ORIGINS, [1.0]).mask(256), "mask: 256 is out of the range"),
    "negative": (lambda *_: anyhit.Instance.spheres(ORIGINS, [1.0]).mask(-1), "mask: -1 is out of the range"),
    "cull mask": (
        lambda pipeline, _: pipeline.trace(SCENE, ORIGINS, [0, 0, 1], cull_mask=256),
        "cull_mask: 256 is out of the range",
    ),
    "two numbers": (
        lambda *_: anyhit.Ray([0, 0], [0, 0, 1]),
        r"origin: expected numbers of shape \(3,\), found \(2,\)",
    ),
    "None": (lambda _, module: anyhit.ShaderTest(module, "sky").payload(None), "values: expected a dict"),
    "path": (lambda *_: untyped.Module.open(7), "path: expected str or os.PathLike, found int"),
    "text": (lambda *_: untyped.Module.from_source("a.wgsl", 7), "text: expected str, found int"),
    "class": (lambda _, module: anyhit.Hit(module, DOWN), "instance: expected anyhit.Instance, found Module"),
    "member of a list": (
        lambda *_: untyped.Scene([None]),
        r"instances\[0\]: expected anyhit.Instance, found NoneType",
    ),
    "float for int": (lambda pipeline, _: pipeline.launch(SCENE, 1.5), "width: 1.5 is a float"),
    "text for int": (lambda pipeline, _: pipeline.launch(SCENE, "3"), "width: expected int, found str"),
    # Its `dtype` is no number's, and an array of it has the module as its item.
    "module for int": (
        lambda *_: untyped.Scene([]).buffer(np, 0, b""),
        "set: expected int or the name of a binding, found module",
    ),
    "module for float": (lambda *_: untyped.Ray([0, 0, np], [0, 0, 1]), "origin: expected a number.*found module"),
    "no binding": (lambda *_: untyped.Scene([]).buffer(0), "binding: missing"),
    "no data": (lambda *_: untyped.Scene([]).buffer(0, 1), "data: missing"),
    "name and binding": (lambda *_: untyped.Scene([]).buffer("a", 0, b""), "leave out the binding"),
    "no such name": (
        lambda _, module: anyhit.ShaderTest(module, "sky").buffer("a", b""),
        "no shader uses a binding named `a`",
    ),
    "flags": (lambda pipeline, _: pipeline.trace(SCENE, ORIGINS, [0, 0, 1], flags=1 << 20), "SPIR-V ray flags"),
}


@pytest.mark.parametrize("name", list(MISTAKES))
def test_mistakes_are_told_in_the_words_of_python(
    name: str, pipeline: anyhit.Pipeline, builtins: anyhit.Module
) -> None:
    call, message = MISTAKES[name]
    with pytest.raises(anyhit.Error, match=message) as raised:
        call(pipeline, builtins)
    text = str(raised.value) + raised.value.message + "".join(raised.value.notes)
    # Neither Rust's paths and types, nor options of the command line, nor PyO3's words.
    for foreign in [r"\w::\w", r"\bRust\b", r"Cargo", r"--[a-z]", r"extract", r"<class"]:
        assert not re.search(foreign, text), text
    if re.search("expected (?!numbers)|missing", message):
        assert isinstance(raised.value, TypeError) and isinstance(raised.value, anyhit.InvalidType)
    again = pickle.loads(pickle.dumps(raised.value))
    assert (type(again), str(again)) == (type(raised.value), str(raised.value))


def test_a_method_as_a_statement_warns(builtins: anyhit.Module) -> None:
    test = anyhit.ShaderTest(builtins, "sky")
    compute = anyhit.ComputeTest(anyhit.Module.from_source("c.wgsl", COMPUTE))
    ball = anyhit.Instance.spheres([[0, 0, 0]], 1.0)
    scene = anyhit.Scene([ball])
    with pytest.warns(RuntimeWarning, match="the ShaderTest that `payload` returned was not used"):
        test.payload({"t": 1})
    with pytest.warns(RuntimeWarning, match="the ComputeTest that `workgroups` returned"):
        compute.workgroups(2)
    with pytest.warns(RuntimeWarning, match="the Instance that `translate` returned"):
        ball.translate([1, 0, 0])
    with pytest.warns(RuntimeWarning, match="the Scene that `buffer` returned"):
        scene.buffer(0, 0, b"")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        changed = test.payload({"t": 1})
        assert changed.run().payload["t"] == -1
        kept = scene.buffer(0, 0, b"")
        # One that a variable names is no statement, used or not.
        kept = scene
        anyhit.Scene([ball.translate([1, 0, 0]).opaque()])
        test.payload({"t": 1}).fuel(100).run()
    assert kept is scene
    # A filter that makes errors of warnings, and an exception on its way, end no process.
    code = "import anyhit, warnings; warnings.simplefilter('error'); anyhit.Instance.spheres([[0, 0, 0]], 1.0).opaque()"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 0 and "was not used" in ended.stderr


def test_the_representation_of_an_error_is_its_report() -> None:
    details: dict[str, object] = {"kind": "Trap"}
    details["itself"] = details
    assert repr(anyhit.Trap("error: x\n", details)) == r"Trap('error: x\n')"


def test_rays_are_values() -> None:
    ray = anyhit.Ray([0, 0, 1], np.array([0, 0, -1.0]), t_max=np.float32(5))
    same = anyhit.Ray((0, 0, 1), [-0.0, 0, -1], 0, 5)
    assert ray == same and hash(ray) == hash(same) and ray != anyhit.Ray([0, 0, 1], [0, 0, -1])
    assert ray != (0, 0, 1)
    for again in [pickle.loads(pickle.dumps(ray)), copy.copy(ray), copy.deepcopy(ray)]:
        assert again == ray
    assert eval(repr(ray), {"Ray": anyhit.Ray, "inf": math.inf}) == ray


def test_programs_are_values(builtins: anyhit.Module) -> None:
    sky, again, shade = (anyhit.Program(builtins, name) for name in ("sky", "sky", "shade"))
    other = anyhit.Program(anyhit.Module.from_source("c.wgsl", COMPUTE))
    assert sky == again and hash(sky) == hash(again) and len({sky, again, shade, other}) == 3
    assert sky != shade and sky != other and sky != builtins
    for one in (sky, shade, other):
        assert pickle.loads(pickle.dumps(one)) == one
    unpickled = pickle.loads(pickle.dumps(sky))
    traced = anyhit.Pipeline(miss=[unpickled]).trace(anyhit.Scene([]), [0, 0, 4], [0, 0, -1])
    assert traced.payload["t"].tolist() == [-1]


def instances() -> list[anyhit.Instance]:
    """Instances that differ in one thing each."""
    move = np.eye(3, 4, dtype=np.float32)
    one = anyhit.Instance.triangles(TRIANGLE)
    ball = anyhit.Instance.spheres([[0, 0, 0], [1, 2, 3]], [0.5, 0.25])
    chain = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    ends = np.array([0, 1], np.uint32)
    return [
        *(one, ball, one.and_(ball), ball.and_(one), one.opaque(), one.geometry_flags(2), one.custom_index(7)),
        *(one.mask(1), one.sbt_offset(3), one.flags(1), one.cluster_id(0), one.cluster_id(2**32 - 1)),
        *(one.translate([1, 0, 0]), one.motion(move, move), one.motion(move, 2 * move), one.vertices_t1(TRIANGLE)),
        anyhit.Instance.triangles(TRIANGLE, np.array([0, 1, 2], np.uint32)),
        anyhit.Instance.triangles(np.zeros((0, 3), np.float32)),
        anyhit.Instance.aabbs([[[0, 0, 0], [1, 1, 1]]]),
        anyhit.Instance.lss(chain[:2], [1.0, 2.0]),
        anyhit.Instance.lss(chain[:2], [1.0, 2.0], end_caps=False),
        anyhit.Instance.lss(chain, [1.0, 2.0, 1e-45], ends),
    ]


def test_instances_and_hits_are_values() -> None:
    for one, again in zip(instances(), instances()):
        assert one == again and hash(one) == hash(again) and one != DOWN
        assert pickle.loads(pickle.dumps(one)) == one
    assert len(set(instances())) == len(instances())
    zero, minus = (anyhit.Instance.spheres([[x, 0, 0]], 1.0) for x in (0.0, -0.0))
    assert zero == minus and hash(zero) == hash(minus)
    ball, up = anyhit.Instance.spheres([[0, 0, 0]], 0.5), anyhit.Ray([0, 0, -4], [0, 0, 1])
    hits = [
        *(anyhit.Hit(ball, DOWN), anyhit.Hit(ball, up), anyhit.Hit(ball.mask(1), DOWN)),
        *(anyhit.Hit(ball, DOWN, ray_flags=1), anyhit.Hit(ball, DOWN, cull_mask=1), anyhit.Hit(ball, DOWN, time=0.5)),
    ]
    assert anyhit.Hit.sphere([0, 0, 0], 0.5, DOWN) == hits[0] and len(set(hits)) == len(hits)
    for hit in hits:
        again = pickle.loads(pickle.dumps(hit))
        assert again == hit and hash(again) == hash(hit)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pickle.dumps(ball.opaque())


def test_bytes_that_are_no_pickled_instance_are_refused() -> None:
    restore: Any
    restore, (data,) = instances()[-1].__reduce__()
    assert restore(data) == instances()[-1]
    for wrong in [*(data[:end] for end in range(len(data))), data + bytes(4), b"\xff" * len(data), bytes(4) + data]:
        with pytest.raises(anyhit.InvalidArgument, match="a pickled instance is broken"):
            restore(wrong)


def test_traces_are_equal_where_their_arrays_are(pipeline: anyhit.Pipeline) -> None:
    scene = anyhit.Scene([anyhit.Instance.spheres([[0, 0, 0]], 0.5)])
    hit, again, miss = (pipeline.trace(scene, [x, 0, 4], [0, 0, -1]) for x in (0, 0, 9))
    # The position of a miss is not a number, of the same bits each time.
    assert hit == again != miss and miss == pipeline.trace(scene, [9, 0, 4], [0, 0, -1])
    assert hit != pipeline.trace(scene, np.array([[0, 0, 4]] * 2, np.float32), [0, 0, -1]) and hit != scene
    with pytest.raises(TypeError):
        hash(hit)


def test_a_pickled_program_keeps_its_specialization() -> None:
    module = anyhit.Module.open(FIXTURES / "pass/harness/conversions/types.comp.spv")
    # The constants 3 to 5 are a uint, 5, a float, 0.5, and a bool, true.
    default = anyhit.Program(module)
    assert default == anyhit.Program(module, specialization={3: 5, 4: 0.5, 5: True})
    constants: dict[int, Any]
    for constants in ({3: 2**32 - 1}, {4: -0.25}, {5: False}, {3: 0, 4: 2.0**-149, 5: False}):
        one = anyhit.Program(module, specialization=constants)
        again = pickle.loads(pickle.dumps(one))
        assert again == one != default and hash(again) == hash(one)


def test_specialization_constants_are_set(glslang: None) -> None:
    text = """#version 460
    #extension GL_EXT_ray_tracing : require
    layout(constant_id = 3) const uint N = 5;
    layout(constant_id = 4) const float F = 0.5;
    layout(location = 0) rayPayloadInEXT vec2 p;
    void main() { p = vec2(N, F); }
    """
    module = anyhit.Module.from_source("s.rmiss", text)

    def payload(constants: Any) -> Any:
        return anyhit.ShaderTest(module, specialization=constants).run().payload

    assert payload(None) == payload({}) == [5, 0.5]
    assert payload({3: 7, 4: np.float32(0.25)}) == [7, 0.25]
    pipeline = anyhit.Pipeline(miss=[anyhit.Program(module, specialization={3: 9})])
    assert pipeline.trace(anyhit.Scene([]), [0, 0, 0], [0, 0, 1]).payload.tolist() == [[9, 0.5]]
    # The module itself is as it was.
    assert payload(None) == [5, 0.5]
    wrong: Any
    for wrong in [{5: 1}, {3: -1}, {3: 1.5}, {3: "1"}, {"N": 1}, [3], {3: [1]}]:
        with pytest.raises(anyhit.InvalidArgument):
            payload(wrong)


def objects() -> list[Any]:
    """Objects that a caller may pass by mistake."""
    endless: list[Any] = []
    endless.append(endless)
    knot: dict[str, Any] = {}
    knot["t"] = knot
    deep: Any = 1
    for _ in range(2000):
        deep = [deep]
    out: list[Any] = [None, True, "", "red", "\ud800", b"", b"ab", bytearray(3), memoryview(b"abcd")]
    out += [0, 1, -1, 255, 256, 2**31, 2**32, 2**64, -(2**63), 10**400, math.nan, math.inf, -math.inf, 1e300, 5e-324]
    out += [[], [[]], [None], ["x"], [1, 2], [1, 2, 3], [[1, 2, 3]] * 3, [1, "2", 3], [[1], [1, 2]], endless, deep]
    out += [(), (1,), (0, 1), {}, {"t": 1}, {1: 2}, {(): ()}, {"t": {"u": []}}, {(0, 1): [1.0]}, knot, {1, 2}, range(3)]
    out += [iter([1]), lambda: 0, object(), type, Ellipsis, 1j, complex("nan"), slice(2), NotImplemented, anyhit, pytest]
    out += [np.float32(1), np.int64(-1), np.bool_(True), np.longdouble(1), np.datetime64("NaT"), np.str_("t")]
    for dtype in ["?", "i1", "u1", "i2", "f2", "i4", "u4", ">u4", "f4", ">f4", "i8", "u8", "f8", "F", "O", "S3", "U2", "V7", "M8[s]"]:
        for shape in [(), (0,), (3,), (1, 3), (2, 3, 3), (1, 1, 4), (0, 3), (2, 2, 2, 2, 2)]:
            out.append(np.zeros(shape, dtype))
    floats = np.arange(36, dtype=np.float32).reshape(4, 3, 3)
    out += [floats[::2], floats[::-1], floats.T, floats[:, ::2], np.broadcast_to(np.float32(1), (4, 3))]
    out += [np.lib.stride_tricks.as_strided(floats, (4, 3), (0, 0)), np.ma.masked_array([1.0], [True])]
    out += [np.zeros(2, [("t", "f4")]), np.zeros((), [("a", "f4", 3), ("b", "O")])[()], np.zeros(1, [("n", [("n", "u4")])])]
    out += [np.array([[None]]), np.array([endless], dtype=object), np.full(3, np.nan, np.float32)]
    frozen = np.zeros((1, 3), np.float32)
    frozen.flags.writeable = False
    out.append(frozen)
    out += [anyhit.Instance.spheres([[0, 0, 0]], 1.0), DOWN, anyhit.Scene([]), anyhit.Sampler()]
    return out


def public(builtins: anyhit.Module, pipeline: anyhit.Pipeline) -> dict[str, Callable[..., object]]:
    """Every public callable: classes, their static methods, and methods of an object of each."""
    compute = anyhit.ComputeTest(anyhit.Module.from_source("c.wgsl", COMPUTE))
    compute = compute.buffer("numbers", np.zeros(2, np.float32)).buffer("results", np.zeros(2, np.float32))
    instance = anyhit.Instance.spheres([[0, 0, 0]], 1.0)
    scene = anyhit.Scene([instance])
    test = anyhit.ShaderTest(builtins, "sky")
    traced = anyhit.ShaderTest(anyhit.Module.open(FIXTURES / "pass/payload/structs/main.rchit.spv"))
    call = traced.hit(anyhit.Hit.triangle(TRIANGLE, DOWN)).on_trace(lambda call: None).run()
    loaded = anyhit.Scene.open(FIXTURES.parent / "shaders/pass/sphere/closest-hit/scene.toml")
    things: list[Any] = [compute, compute.run(), instance, scene, pipeline, builtins, builtins.entry_points[0], DOWN]
    things += [test, test.run(), call.traces[0], loaded, loaded.launch(), anyhit.Program(builtins, "sky"), anyhit.Sampler()]
    things += [anyhit.Hit.triangle(TRIANGLE, DOWN), anyhit.DeviceBuffers(), pipeline.trace(scene, [0, 0, 4], [0, 0, -1])]
    found: dict[str, Callable[..., object]] = {}
    for name in anyhit.__all__:
        thing = getattr(anyhit, name)
        if inspect.isclass(thing) and issubclass(thing, Exception):
            continue
        if callable(thing):
            found[name] = thing
    for thing in things:
        for name in dir(thing):
            if (not name.startswith("_") or name in ("__eq__", "__hash__", "__repr__")) and callable(getattr(thing, name)):
                found[f"{type(thing).__name__}.{name}"] = getattr(thing, name)
    # What runs for as long as its arguments say, and what reads whatever folder is named.
    for name in ["stress", "ComputeTest.many_seeds", "LoadedScene.many_seeds", "Suite", "LoadedScene.launch", "Pipeline.launch"]:
        found.pop(name, None)
    return found


CHUNK = """
import sys, faulthandler
faulthandler.enable()
sys.path[:0] = [{tests!r}]
import test_arguments
test_arguments.call_wrongly({seed}, {count})
"""


def call_wrongly(seed: int, count: int) -> None:
    """Calls every public callable with odd arguments."""
    import conftest

    builtins = anyhit.Module.from_source("builtins.wgsl", conftest.BUILTINS)
    shade, sky = (anyhit.Program(builtins, name) for name in ("shade", "sky"))
    callables = public(builtins, anyhit.Pipeline(hit=[shade], miss=[sky]))
    draw = random.Random(seed)
    odd = objects()
    warnings.simplefilter("ignore")
    for name, function in callables.items():
        try:
            names = [one for one in inspect.signature(function).parameters.values() if one.name != "self"]
        except ValueError:
            names = []
        for turn in range(count):
            # One argument at each place, then several at once, some of them right.
            right: list[Any] = [builtins, 0, 0, "main", DOWN, [0, 0, 1]]
            positional = [one for one in names if one.kind is not one.KEYWORD_ONLY]
            arguments = [draw.choice(odd) if draw.random() < 0.8 else draw.choice(right) for _ in positional]
            arguments = arguments[: draw.randint(0, len(arguments) + 1)] if turn % 4 == 3 else arguments
            keywords = {
                one.name: draw.choice(odd) for one in names if one.kind is one.KEYWORD_ONLY and draw.random() < 0.3
            }
            try:
                function(*arguments, **keywords)
            except (anyhit.Error, TypeError, ValueError):
                pass
            except BaseException as error:
                shown = ", ".join(f"{type(one).__name__} {str(one)[:60]!r}" for one in itertools.chain(arguments, keywords.values()))
                raise AssertionError(f"{name}({shown}): {type(error).__name__}: {error}") from error


@pytest.mark.parametrize("seed", range(4))
def test_wrong_calls_end_in_errors(seed: int) -> None:
    """In a process of its own, whose end shows a crash."""
    code = CHUNK.format(tests=str(FIXTURES.parent / "python/tests"), seed=seed, count=250)
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=900)
    assert ended.returncode == 0, ended.stderr[-3000:]
