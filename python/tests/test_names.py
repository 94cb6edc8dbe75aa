"""docs/python-names.md lists the public names of the crate beside those of this package.

`BLESS=1 pytest python/tests/test_names.py` writes the page.
"""

from __future__ import annotations

import os
from typing import Iterator

import anyhit
from conftest import REPOSITORY

PAGE = REPOSITORY / "docs/python-names.md"

# Types and other items of the crate: what Python has for them, or why it has nothing. A backtick
# begins what Python has.
ITEMS = {
    "AddressMode": "`Sampler(address_mode=...)`: texts",
    "Band": "no: an array holds a whole image",
    "BorderColor": "`Sampler(border_color=...)`: texts",
    "Buffer": "no: NumPy arrays are the content of buffers",
    "CallableCall": "`ShaderOutcome.calls` and the arguments of `ShaderTest.on_call`",
    "Case": "`Suite`",
    "CompareOp": "`Sampler(compare_op=...)`: texts",
    "CompileOptions": "`Module.open(flags=...)`",
    "CompilerFlags": "`Module.open(flags=...)`",
    "Component": "`image(format=...)`: GLSL's names",
    "DebugInfoLevel": "`Module.open(flags=...)`",
    "Descriptor": "no: methods bind arrays and samplers",
    "DescriptorElement": "no: part of `Trap.operands`",
    "DeviceProfile": "no: a scene file names its device",
    "Dimension": "`image(...)`: that which the shader declares",
    "EndCaps": "`Instance.lss(end_caps=...)`",
    "ErrorKind": "`Error.kind`, and the class of the exception",
    "Exit": "`ShaderOutcome.exit`: text",
    "Explain": "`ShaderOutcome.explain`, `ComputeTest.explain`, `Pipeline.explain`, `LoadedScene.explain`",
    "ExplainRequest": "`LoadedScene.explain(...)`: a pixel or a name",
    "Filter": "`Sampler(mag_filter=...)`: texts",
    "Format": "`image(format=...)`: GLSL's names",
    "GeometryData": "`Instance.triangles`, `spheres`, `lss`, `aabbs`",
    "GeometryFlags": "`Instance.geometry_flags(...)`: a number",
    "HitKind": "`Traced.kind`: numbers",
    "HitRecord": "`Traced`: arrays; `ExecuteCall.hit`: a dict",
    "HostLayout": "no: a structured dtype is compared where it is bound",
    "HostScene": "no: a trait of Rust",
    "Image": "`image(...)`: arrays",
    "ImageShape": "`image(...)`: the shape of an array",
    "Indexing": "`Instance.lss(indices=...)`",
    "InputLimit": "no: the limits are the defaults",
    "InputLimits": "no: the limits are the defaults",
    "InstanceFlags": "`Instance.flags(...)`: a number",
    "Language": "`Module.from_source(...)`: the extension of the name",
    "LaunchLimits": "no: `fuel`, and signals such as that of pytest-timeout",
    "Motion": "`Instance.motion(start, end)`",
    "NestedScalars": "no: lists of numbers",
    "Optimize": "`Module.open(flags=...)`",
    "PipelineBuilder": "`Pipeline(...)`: keywords",
    "PipelineFlags": "no: a scene file sets them",
    "Place": "`Error.span`",
    "Precision": "`Scene(precision=...)`: text",
    "PrintedLine": "`Launched.printed`: launch index and text",
    "RayFlags": "`Pipeline.trace(flags=...)`: a number",
    "RayOperands": "`Pipeline.trace(...)`: keywords",
    "ReportedHit": "`ShaderOutcome.reports`: dicts",
    "Result": "no: errors are exceptions",
    "Sbt": "`Pipeline(hit_records=...)`",
    "SbtRecord": "`Pipeline(hit_records=...)`",
    "ScalarValue": "no: numbers",
    "Scalars": "no: numbers, lists and arrays",
    "SeededRuns": "`ComputeTest.many_seeds`",
    "ShaderFrame": "`Trap.stack`: dicts",
    "SmokeOptions": "no: the command `anyhit smoke`",
    "SmokeReport": "no: the command `anyhit smoke`",
    "Source": "`Module.from_source(...)`",
    "Srt": "no: `Instance.motion` takes two matrices",
    "Stage": "`EntryPoint.stage`, `Program.stage`: texts",
    "Stats": "`Launched.stats`: a dict",
    "StreamedImage": "no: an array holds a whole image",
    "StructData": "no: dicts are laid out where they are bound",
    "Texels": "`Launched.image(...)`: an array",
    "TraceRay": "`TraceCall.ray`, `flags`, `cull_mask`, `time`",
    "TrapCode": "`Trap.code`: text",
    "TrapOperands": "`Trap.operands`: a dict",
    "TypedBytes": "no: dicts",
    "ValidationClass": "no: the texts of `Module.validate`",
    "ValidationFinding": "`Module.validate`: texts",
    "Value": "no: numbers, lists and dicts",
    "Warning": "`Module.warnings`: texts",
    "WarningReports": "`LoadedScene.sanitize`: texts",
    "assert_near": "no: `pytest.approx`",
    "assert_payload_eq": "no: `==`",
    "assert_ulps": "no: `numpy.testing.assert_array_max_ulp`",
    "cases": "no: the plugin for pytest collects cases",
    "host_layout": "no: a structured dtype is compared where it is bound",
    "strategies": "no: proptest's; Hypothesis draws arrays",
}

# Members of types that both have, of one type or (*) of all.
MEMBERS = {
    "*::new()": "the constructor",
    "*::of()": "the constructor",
    "*::with_stage()": "the constructor: `stage=`",
    "*::bind_buffer()": "no: a buffer is bound where its array is given",
    "*::buffer_bytes()": "`read_buffer(..., numpy.uint8)`, `buffer(..., bytes)`",
    "*::descriptor()": "no: arrays go from an outcome into the next test",
    "*::heap()": "no: a scene file fills descriptor heaps",
    "*::heap_buffer()": "no: a scene file fills descriptor heaps",
    "*::heap_data()": "no: a scene file fills descriptor heaps",
    "*::push_constant_bank()": "no: a scene file has banks of push constants",
    "*::read_heap_buffer()": "no: `LoadedScene.launch` has it by name",
    "*::image_sampler()": "`image(..., sampler=...)`",
    "*::launch_limits()": "no: `fuel`, and signals such as that of pytest-timeout",
    "*::push_constants_bytes()": "no: `push_constants` takes a dict",
    "*::push_constants_data()": "`push_constants`",
    "*::run_mut()": "no: bind what `read_buffer` returns",
    "*::buffer_at()": "`device_buffers`",
    "*::read_buffer_at()": "no: outcomes have it",
    "ComputeTest::buffer_at()": "`device_buffers`",
    "Error::and_more()": "no: it builds an error",
    "Error::at()": "no: it builds an error",
    "Error::at_with()": "no: it builds an error",
    "Error::context()": "no: it builds an error",
    "Error::io()": "no: it builds an error",
    "Error::new()": "no: it builds an error",
    "Error::not_shown()": "no: `others` has all",
    "Error::note()": "no: it builds an error",
    "Error::or_at()": "no: it builds an error",
    "Error::places()": "`spans`",
    "Error::render()": "`report`",
    "Error::render_coloured()": "no: `report` without colours",
    "Error::trap()": "the exception `Trap`",
    "ExecuteCall::trace": "`ray`",
    "Hit::cull_mask()": "the constructor: `cull_mask=`",
    "Hit::ray()": "the constructor",
    "Hit::ray_flags()": "the constructor: `ray_flags=`",
    "Hit::time()": "the constructor: `time=`",
    "Instance::aabb()": "`aabbs`",
    "Instance::and()": "`and_`: `and` is a keyword",
    "Instance::chain()": "`lss`, with indices",
    "Instance::sphere()": "`spheres`",
    "Instance::triangle()": "`triangles`",
    "LoadedScene::launch_each()": "`launch` for each size",
    "LoadedScene::motion()": "no: `transform` at time 0",
    "LoadedScene::set_buffer_bytes()": "`set_buffer`",
    "LoadedScene::set_launch_size()": "`launch(width, height)`",
    "LoadedScene::set_push_constants_bytes()": "`set_push_constants`",
    "LoadedScene::set_push_constants_data()": "`set_push_constants`",
    "LoadedScene::set_shader_record()": "no: the scene file has its records",
    "LoadedScene::set_shader_record_bytes()": "no: the scene file has its records",
    "LoadedScene::set_shader_record_data()": "no: the scene file has its records",
    "LoadedScene::open()": "`Scene.open`",
    "LoadedScene::from_text()": "`Scene.from_text`",
    "Module::compile()": "`open`, `from_source`",
    "Module::specialize()": "`specialization=` of `Program`, `ShaderTest` and `ComputeTest`",
    "Module::specialize_data()": "no: `specialization=` takes numbers",
    "Pipeline::builder()": "the constructor",
    "Pipeline::launch_bands()": "no: an array holds a whole image",
    "Pipeline::launch_mut()": "`launch`, whose outcome has the next `scene`",
    "Pipeline::trace_mut()": "`trace`, whose result has the next `scene`",
    "Program::module": "no: the module that made it",
    "Ray::MAX_MAGNITUDE": "no: of checks of Rust code",
    "Ray::MIN_MAGNITUDE": "no: of checks of Rust code",
    "Ray::goes_nowhere()": "no: of checks of Rust code",
    "Ray::is_finite()": "no: `numpy.isfinite`",
    "Ray::is_well_scaled()": "no: of checks of Rust code",
    "Ray::with_interval()": "the constructor: `t_min=`, `t_max=`",
    "Scene::precision()": "the constructor: `precision=`",
    "SceneOutcome::pass": "no: `LoadedScene.launch_pass`",
    "ShaderTest::call_answers()": "`on_call`",
    "ShaderTest::execute_answers()": "`on_execute`",
    "ShaderTest::hit_object_record()": "no: `shader_record`",
    "ShaderTest::payload_member()": "`payload`",
    "ShaderTest::shader_record_bytes()": "no: `shader_record` takes a dict",
    "ShaderTest::shader_record_data()": "`shader_record`",
    "ShaderTest::trace_answers()": "`on_trace`",
    "TraceCall::trace": "`ray`, `flags`, `cull_mask`, `time`",
    "Traced::buffer()": "`scene.read_buffer`",
    "Traced::buffer_at()": "no: `Pipeline.launch` has it",
    "Traced::buffer_bytes()": "`scene.read_buffer`",
    "Traced::descriptor()": "no: arrays go from an outcome into the next test",
    "Traced::image()": "`scene.read_image`",
    "Traced::missed()": "`~hit`",
    "Traced::read_buffer()": "`scene.read_buffer`",
    "Traced::read_buffer_at()": "no: `Pipeline.launch` has it",
    "Trap::fault_value": "`operands`",
    "Trap::frame()": "`stack`",
}
for _setting in (
    "address_mode",
    "compare_op",
    "lod_bias",
    "mag_filter",
    "max_anisotropy",
    "max_lod",
    "min_filter",
    "min_lod",
    "mipmap_mode",
    "unnormalized_coordinates",
):
    MEMBERS[f"Sampler::{_setting}"] = f"the constructor: `{_setting}=`"


def rust() -> Iterator[tuple[str, list[str]]]:
    """Each public item of the crate, and its members."""
    members: list[str] = []
    item = ""
    for line in (REPOSITORY / "tests/public_names.txt").read_text("utf-8").splitlines():
        if line.startswith("  "):
            members.append(line.strip().partition("::")[2])
            continue
        if item:
            yield item, members
        item, members = line.split(" ", 1)[1].partition("::")[0], []
    yield item, members


def page() -> str:
    lines = [
        "# Names of Rust and Python",
        "",
        "The public names of the crate, and what the [Python package](python.md) has for them. `python/tests/test_names.py`",
        "writes this page, and fails where a name is missing.",
        "",
        "## Items",
        "",
        "| Rust | Python |",
        "|---|---|",
    ]
    both: list[tuple[str, list[str]]] = []
    seen: set[str] = set()
    for item, members in rust():
        if item in seen:
            continue
        seen.add(item)
        if item in anyhit.__all__:
            both.append((item, members))
            lines.append(f"| `{item}` | `{item}` |")
        else:
            lines.append(f"| `{item}` | {ITEMS.pop(item)} |")
    lines += ["", "## Members", "", "Members that Python does not have under the same name.", "", "| Rust | Python |", "|---|---|"]
    used: set[str] = set()
    missing: list[str] = []
    for item, members in both:
        for member in members:
            name = member.removesuffix("()")
            if hasattr(getattr(anyhit, item), name):
                continue
            keys = [key for key in (f"{item}::{member}", f"*::{member}") if key in MEMBERS]
            if not keys:
                missing.append(f"{item}::{member}")
                continue
            used.add(keys[0])
            lines.append(f"| `{item}::{name}` | {MEMBERS[keys[0]]} |")
    assert not missing, missing
    # Nothing is explained that is not there.
    assert not ITEMS, ITEMS
    unused = set(MEMBERS) - used
    assert not unused, unused
    return "\n".join(lines) + "\n"


def test_every_name_of_the_crate_has_its_row() -> None:
    text = page()
    if os.environ.get("BLESS"):
        PAGE.write_text(text, "utf-8")
    assert PAGE.read_text("utf-8") == text, "BLESS=1 pytest python/tests/test_names.py"
