"""Calls every public callable of anyhit with odd arguments. Prints each exception that is neither
``anyhit.Error`` nor ``TypeError`` nor ``ValueError``, and as its last line the number of calls.

``python wrong_calls.py [NAME]``: of all callables, or of those whose names contain a text.
"""

from __future__ import annotations

import collections
import copy
import faulthandler
import inspect
import os
import pickle
import random
import sys
import tempfile
import warnings
from typing import Any, Callable

import anyhit
import numpy as np
from odd_arguments import Raises, odd_arguments

WGSL = """
enable wgpu_ray_tracing_pipeline;

struct Payload { position: vec3f, t: f32 }
struct Light { position: vec3f, power: f32 }

@group(0) @binding(0) var structure: acceleration_structure;
@group(0) @binding(1) var<storage, read_write> lights: array<Light>;
@group(0) @binding(2) var picture: texture_storage_2d<rgba8unorm, read_write>;
@group(0) @binding(3) var plane: texture_2d<f32>;
@group(0) @binding(4) var filtering: sampler;

var<ray_payload> sent: Payload;
var<incoming_ray_payload> payload: Payload;

@ray_generation
fn begin(@builtin(ray_invocation_id) id: vec3u) {
    lights[0].power = f32(id.x);
    sent = Payload();
    traceRay(structure, RayDesc(0u, 0xffu, 0.0, 100.0, vec3f(0.0, 0.0, 4.0), vec3f(0.0, 0.0, -1.0)), &sent);
    textureStore(picture, vec2i(0, 0), vec4f(sent.t));
}

@closest_hit @incoming_payload(payload)
fn shade(@builtin(ray_t_current_max) t: f32) { payload.t = t; }

@miss @incoming_payload(payload)
fn sky() { payload.t = -1.0; }

@miss @incoming_payload(payload)
fn mirror() {
    sent = Payload();
    traceRay(structure, RayDesc(0u, 0xffu, 0.0, 100.0, vec3f(0.0, 0.0, 4.0), vec3f(0.0, 0.0, -1.0)), &sent);
    payload.t = sent.t;
}

@compute @workgroup_size(2)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&lights)) { lights[id.x].power *= 2.0; }
    textureStore(picture, vec2i(0, 0), textureSampleLevel(plane, filtering, vec2f(0.5), 0.0));
}
"""
SCENE = """
version = 1
launch = [2, 1]
[shaders]
all = "all.wgsl"
[pipeline]
raygen = "all:begin"
miss = ["all:sky"]
hit = [{ closest_hit = "all:shade" }]
[geometry.ball]
type = "spheres"
positions = [[0, 0, 0]]
radii = 0.5
[[instance]]
geometry = "ball"
[resources.structure]
type = "acceleration_structure"
binding = 0
[resources.lights]
type = "storage_buffer"
binding = 1
size = 32
[resources.picture]
type = "storage_image"
binding = 2
format = "rgba8"
size = [2, 1]
[[ray]]
name = "down"
origin = [0, 0, 4]
direction = [0, 0, -1]
expect = { t = 3.5 }
"""

# Numbers that say how much is done: a call with a large one is right, and takes long.
SIZES = {"width", "height", "depth", "x", "y", "z", "groups", "end", "seeds", "perturb", "many_seeds", "size", "count"}
SIZES |= {"outputs", "fuel", "instructions"}

MODULE = anyhit.Module.from_source("all.wgsl", WGSL)
LIGHTS = np.zeros((2, 4), np.float32).view([("position", "f4", (3,)), ("power", "f4")])[:, 0]
TEXELS = np.zeros((1, 2, 4), np.float32)


def good_arguments(folder: str) -> dict[str, Any]:
    """An argument that is right, by its name, with that of the callable where it matters."""
    with open(f"{folder}/all.wgsl", "w") as file:
        file.write(WGSL)
    with open(f"{folder}/down.test.toml", "w") as file:
        file.write(SCENE)
    ray = anyhit.Ray([0, 0, 4], [0, 0, -1])
    ball = anyhit.Instance.spheres([[0, 0, 0]], [0.5])
    scene = anyhit.Scene([ball])
    good: dict[str, Any] = {
        "module": MODULE, "entry": "shade", "ComputeTest.entry": "main", "path": f"{folder}/down.test.toml",
        "Module.open.path": f"{folder}/all.wgsl", "from_source.text": WGSL, "from_text.text": SCENE,
        "spirv": bytes(40), "Module.from_source.name": "all.wgsl", "set_shader_source.name": "all",
        "set_shader_spirv.name": "all", "LoadedScene.module.name": "all", "set_shader_source.text": WGSL,
        "name": "lights", "image.name": "picture", "builtin.name": "HitKindKHR", "launch_pass.name": "0",
        "file_name": f"{folder}/all.wgsl", "value": 255, "instances": [ball], "instance": ball, "ray": ray,
        "LoadedScene.set_transform.instance": 0, "LoadedScene.transform.instance": 0,
        "LoadedScene.set_motion.instance": 0, "other": ball, "scene": scene, "hit": anyhit.Hit(ball, ray),
        "Pipeline.hit": [anyhit.Program(MODULE, "shade")], "miss": [anyhit.Program(MODULE, "sky")],
        "ray_generation": anyhit.Program(MODULE, "begin"), "origin": [0, 0, 4], "direction": [0, 0, -1],
        "origins": np.zeros((3, 3), np.float32), "directions": [0, 0, -1], "vertices": np.zeros((3, 3), np.float32),
        "positions": np.zeros((2, 3), np.float32), "radii": np.ones(2, np.float32), "indices": np.zeros(1, np.uint32),
        "boxes": np.zeros((1, 2, 3), np.float32), "matrix": np.eye(3, 4, dtype=np.float32), "by": [1, 2, 3],
        "start": np.eye(3, 4, dtype=np.float32), "end": np.eye(3, 4, dtype=np.float32), "stress.end": 2, "first": 0,
        "seed": 1, "seeds": 2, "set": 0, "binding": 1, "data": LIGHTS, "set_buffer.data": LIGHTS, "texels": TEXELS,
        "image.binding": 2, "sampler.binding": 4, "bind.binding": 0, "sampler": anyhit.Sampler(), "format": "rgba8",
        "position": [0, 0, 0], "radius": 0.5, "minimum": [-1] * 3, "maximum": [1] * 3, "width": 2, "height": 1,
        "id": [0, 0, 0], "launch.size": [1, 1, 1], "subgroup_size.size": 32, "reserve.size": 64, "commands": "continue",
        "address": 0x10000, "member": "position", "degrees": 1.0, "what": (0, 0), "at": 0, "x": 1, "y": 1, "z": 1,
        "buffers": anyhit.DeviceBuffers(), "payload": {"t": 1}, "values": {"t": 1}, "callback": lambda *_: None,
        "inputs": {"lights": LIGHTS}, "outputs": {"lights": 2}, "attributes": [0, 0], "precision": "exact",
        "report": "error: x", "details": {}, "finished": None, "instructions": 1000, "mask": 1, "custom_index": 1,
        "cluster_id": 1, "flags": 0, "Module.open.flags": [], "Module.from_source.flags": [], "include_folders": [],
        "sbt_offset": 0, "depth": 1, "other_object": 1,
    }
    return good


def receivers(folder: str) -> dict[str, Any]:
    """An object of each class."""
    ray = anyhit.Ray([0, 0, 4], [0, 0, -1])
    ball = anyhit.Instance.spheres([[0, 0, 0]], [0.5])
    shade, sky, begin = (anyhit.Program(MODULE, name) for name in ("shade", "sky", "begin"))
    pipeline = anyhit.Pipeline(ray_generation=begin, hit=[shade], miss=[sky])
    scene = anyhit.Scene([ball]).bind("structure").buffer("lights", LIGHTS).image("picture", TEXELS)
    test = anyhit.ShaderTest(MODULE, "shade").hit(anyhit.Hit(ball, ray))
    compute = anyhit.ComputeTest(MODULE, "main").buffer(0, 1, LIGHTS).image(0, 2, TEXELS).image(0, 3, TEXELS)
    compute = compute.sampler(0, 4, anyhit.Sampler())
    mirror = anyhit.ShaderTest(MODULE, "mirror").ray(ray).on_trace(lambda _: {"t": 1}).run()
    loaded = anyhit.Scene.open(f"{folder}/down.test.toml")
    suite = anyhit.Suite(f"{folder}/down.test.toml")
    traced = pipeline.trace(scene, np.zeros((3, 3), np.float32), [0, 0, -1])
    all_objects = [ray, ball, shade, pipeline, scene, test, compute, mirror, loaded, suite, traced, MODULE]
    all_objects += [anyhit.Hit(ball, ray), anyhit.Sampler(), anyhit.DeviceBuffers(), mirror.traces[0], suite.run(0)]
    all_objects += [loaded.launch(), pipeline.launch(scene, 2), compute.run(), MODULE.entry_points[0], MODULE.bindings[0]]
    return {type(one).__name__: one for one in all_objects}


def callables(objects: dict[str, Any]) -> list[tuple[str, Callable[..., Any]]]:
    """Constructors, functions and methods with the names that messages have."""
    found: list[tuple[str, Callable[..., Any]]] = []
    for name in anyhit.__all__:
        one = getattr(anyhit, name)
        if not callable(one):
            continue
        found.append((name, one))
        if not isinstance(one, type) or issubclass(one, BaseException):
            continue
        for member in dir(one):
            is_static = isinstance(inspect.getattr_static(one, member), staticmethod)
            receiver = one if is_static else objects.get(name)
            if not member.startswith("_") and receiver is not None and callable(getattr(one, member)):
                found.append((f"{name}.{member}", getattr(receiver, member)))
        for operator in ("__eq__", "__lt__", "__getitem__", "__contains__", "__call__", "__setstate__", "__reduce_ex__"):
            # Those of `object` are Python's.
            is_own = getattr(one, operator, None) is not getattr(object, operator, None)
            if name in objects and is_own and hasattr(objects[name], operator):
                found.append((f"{name}.{operator}", getattr(objects[name], operator)))
    return found


class Calls:
    """The calls so far, and what they raised that they must not."""

    def __init__(self) -> None:
        self.count = 0
        self.of: collections.Counter[str] = collections.Counter()
        self.wrong: dict[str, str] = {}

    def call(self, name: str, function: Callable[..., Any], args: list[Any], keywords: dict[str, Any]) -> None:
        self.count += 1
        self.of[name] += 1
        try:
            result = function(*args, **keywords)
            # Accepted values can be shown and compared.
            repr(result)
            _ = result == result
        except (anyhit.Error, TypeError, ValueError, Raises):
            pass
        except BaseException as error:  # noqa: BLE001 (a panic is none of Exception)
            if isinstance(error, KeyboardInterrupt):
                raise
            key = f"{name}: {type(error).__name__}: {str(error)[:120]}"
            if key not in self.wrong:
                self.wrong[key] = shown([*args, *keywords.items()])
                print(f"{key}\n    with {self.wrong[key]}", flush=True)


def shown(values: list[Any]) -> str:
    def one(value: Any) -> str:
        try:
            text = f"{value.dtype}{value.shape}" if isinstance(value, np.ndarray) else repr(value)
        except BaseException as error:  # noqa: BLE001
            text = f"<{type(value).__name__} {type(error).__name__}>"
        return text[:80]

    return ", ".join(map(one, values))


def is_large(value: Any, depth: int = 0) -> bool:
    """Whether a number asks for much, itself or inside a list."""
    if isinstance(value, (list, tuple, range)) and depth < 2:
        return any(is_large(part, depth + 1) for part in list(value[:8]))
    if isinstance(value, dict) and depth < 2:
        return any(is_large(part, depth + 1) for part in value.values())
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "iu" and value.size > 0 and bool((value > 64).any())
    return isinstance(value, (int, float, np.number)) and not isinstance(value, np.complexfloating) and bool(value > 64)


def parameters_of(function: Callable[..., Any]) -> list[inspect.Parameter]:
    try:
        return list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):
        return [inspect.Parameter("other_object", inspect.Parameter.POSITIONAL_ONLY)]


def fuzz(calls: Calls, name: str, function: Callable[..., Any], good: dict[str, Any], odd: list[Any]) -> None:
    parameters = parameters_of(function)
    method = name.rpartition(".")[2]
    owner = name.partition(".")[0]

    def right(parameter: inspect.Parameter) -> Any:
        keys = [f"{name}.{parameter.name}", f"{method}.{parameter.name}", f"{owner}.{parameter.name}", parameter.name]
        for key in keys:
            if key in good:
                return good[key]
        return inspect.Parameter.empty

    def call(values: dict[str, Any]) -> None:
        args, keywords = [], {}
        for parameter in parameters:
            if parameter.name in SIZES and parameter.name in values and is_large(values[parameter.name]):
                return
            value = values.get(parameter.name, right(parameter))
            if parameter.kind == inspect.Parameter.KEYWORD_ONLY:
                if value is not inspect.Parameter.empty:
                    keywords[parameter.name] = value
            elif parameter.kind in (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD):
                if value is inspect.Parameter.empty:
                    break
                args.append(value)
        calls.call(name, function, args, keywords)

    for parameter in parameters:
        for value in odd:
            call({parameter.name: value})
    draw = random.Random(name)
    for _ in range(1000 if len(parameters) > 1 else 0):
        call({parameter.name: draw.choice(odd) for parameter in parameters if draw.random() < 0.6})
    # Too few, too many, and unknown arguments.
    for count in range(len(parameters) + 3):
        calls.call(name, function, [None] * count, {})
    calls.call(name, function, [], {"nothing": 1})


def fuzz_callbacks(calls: Calls, odd: list[Any]) -> None:
    """Answers of callbacks."""
    test = anyhit.ShaderTest(MODULE, "mirror").ray(anyhit.Ray([0, 0, 4], [0, 0, -1]))
    def of(value: Any) -> list[Callable[[Any], Any]]:
        return [lambda _: value, lambda _: {"t": value}, lambda trace: trace.hit(value)]

    for value in odd:
        for callback in [*of(value), value]:
            calls.call("ShaderTest.on_trace", test.on_trace(callback).run, [], {})


def read_attributes(calls: Calls, objects: dict[str, Any]) -> None:
    """Attributes, representations and copies of an object of each class."""
    for name, one in objects.items():
        for member in dir(type(one)):
            if not member.startswith("__"):
                calls.call(f"{name}.{member}", getattr, [one, member], {})
        for function in (repr, str, hash, bool, len, iter, list, copy.copy, copy.deepcopy, pickle.dumps, vars):
            calls.call(f"{function.__name__}({name})", function, [one], {})


def main() -> None:
    faulthandler.enable()
    # The end of the input leaves a prompt.
    sys.stdin = open(os.devnull)
    warnings.simplefilter("ignore")
    wanted = sys.argv[1] if len(sys.argv) > 1 else ""
    calls = Calls()
    with tempfile.TemporaryDirectory() as folder:
        good, objects = good_arguments(folder), receivers(folder)
        odd = [*odd_arguments(), *objects.values(), *(type(one) for one in objects.values())]
        all_callables = [one for one in callables(objects) if wanted in one[0]]
        for name, function in all_callables:
            print(f"# {name}", file=sys.stderr, flush=True)
            # An iterator has an end: each callable gets new ones.
            fuzz(calls, name, function, good, [*odd_arguments(), *odd[-2 * len(objects) :]])
        if not wanted:
            read_attributes(calls, objects)
            fuzz_callbacks(calls, odd)
    few = [name for name, _ in all_callables if calls.of[name] < 500 and parameters_of_name(all_callables, name)]
    print(f"{calls.count} calls of {len(all_callables)} callables, {len(odd)} odd arguments, {len(calls.wrong)} wrong, few: {few}")


def parameters_of_name(all_callables: list[tuple[str, Callable[..., Any]]], wanted: str) -> bool:
    return any(parameters_of(function) for name, function in all_callables if name == wanted)


if __name__ == "__main__":
    main()
