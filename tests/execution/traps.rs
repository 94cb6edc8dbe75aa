//! Traps as data, on every route from a shader to an error: code, place, launch index, values and
//! stack, as the sources of the shaders say.

use anyhit::{
    ComputeTest, DescriptorElement, Error, ErrorKind, Instance, LoadedScene, Module, Pipeline, Program, Ray,
    RayOperands, Scene, ShaderFrame, ShaderTest, Stage, Trap, TrapCode, TrapOperands,
};
use anyhit_base::error::ErrorReport;

fn trap(error: &Error) -> &Trap {
    assert_eq!(error.kind(), ErrorKind::Trap, "{}", error.render());
    let trap = error.trap().expect("the data of a trap");
    assert_eq!(error.message(), trap.code.message());
    trap
}

fn module(name: &str) -> std::sync::Arc<Module> {
    Module::open(format!("spirv-fixtures/{name}")).expect("a fixture")
}

fn program(name: &str) -> Program {
    Program::of(&module(name), "main").expect("an entry point")
}

fn launched(scene: &str) -> Error {
    let scene = LoadedScene::open(format!("shaders/fail/{scene}/scene.toml")).expect("a scene");
    scene.launch().expect_err("a trap")
}

/// A frame of `main` by its stage and line.
fn is_at(frame: &ShaderFrame, stage: Stage, file: &str, line: u32) {
    assert_eq!((frame.stage, &*frame.entry_point, frame.line), (stage, "main", Some(line)), "{frame:?}");
    let found = frame.file.as_deref().unwrap_or_default();
    assert!(found.ends_with(file), "{frame:?}");
}

fn descriptor(element: &DescriptorElement) -> (&str, [u32; 3]) {
    (&element.name, [element.set, element.binding, element.element])
}

#[test]
fn of_a_single_shader() {
    // `table` has 4 elements, and line 11 takes the one of the launch index.
    let test = ShaderTest::new(&module("fail/memory/array-index/main.rgen.spv"), "main").unwrap();
    let test = test.buffer(0, 1, &[0.0f32; 6]);
    assert!(test.clone().launch([3, 0, 0], [6, 1, 1]).run().is_ok());
    let error = test.clone().launch([5, 0, 0], [6, 1, 1]).run().unwrap_err();
    let found = trap(&error);
    assert_eq!((found.code, found.launch_id), (TrapCode::IndexOutOfBounds, [5, 0, 0]));
    assert_eq!((found.stage(), found.entry_point()), (Some(Stage::RayGeneration), Some("main")));
    assert_eq!((found.line(), found.vuid.as_deref(), found.fault_value), (Some(11), None, 0));
    let TrapOperands::Index { index, length, of, .. } = &found.operands else { panic!("{found:?}") };
    assert_eq!((*index, *length, of.as_deref()), (Some(5), Some(4), Some("table")));
    let [frame] = &found.stack[..] else { panic!("{found:?}") };
    is_at(frame, Stage::RayGeneration, "fail/memory/array-index/main.rgen", 11);

    let error = test.builtin("LaunchIdKHR", [4u32, 0, 0]).run().unwrap_err();
    assert_eq!(trap(&error).launch_id, [4, 0, 0]);

    // The limit is told by its key.
    let endless = ShaderTest::new(&module("fail/control-flow/endless-loop/main.rgen.spv"), "main").unwrap();
    let error = endless.buffer(0, 1, &[0u32; 4]).launch([3, 0, 0], [4, 1, 1]).fuel(1000).run().unwrap_err();
    let found = trap(&error);
    assert_eq!((found.code, found.launch_id), (TrapCode::OutOfFuel, [3, 0, 0]));
    let TrapOperands::Limit { key, value, .. } = found.operands else { panic!("{found:?}") };
    assert_eq!((key, value), ("fuel", 1000.0));
}

#[test]
fn of_a_compute_shader() {
    // Invocation 1 writes the second word of a buffer of one.
    let test = ComputeTest::new(&module("fail/compute/array-of-buffers/main.comp.spv"), "main").unwrap();
    let error = test.buffer(0, 1, &[0u32]).run().unwrap_err();
    let found = trap(&error);
    assert_eq!((found.code, found.launch_id), (TrapCode::BufferOutOfBounds, [1, 0, 0]));
    let [frame] = &found.stack[..] else { panic!("{found:?}") };
    is_at(frame, Stage::Compute, "array-of-buffers/main.comp", 10);
    let TrapOperands::Buffer { offset, bytes, size, index, length, of, storage_class, .. } = &found.operands
    else {
        panic!("{found:?}")
    };
    assert_eq!((*offset, *bytes, *size, found.fault_value), (4, 4, Some(4), 4));
    assert_eq!((*index, *length, of.as_deref()), (Some(1), Some(1), Some("buffers[].outputs")));
    assert_eq!(*storage_class, None);
    let TrapOperands::Buffer { descriptor: Some(element), .. } = &found.operands else { panic!("{found:?}") };
    assert_eq!(descriptor(element), ("buffers", [0, 1, 0]));
}

#[test]
fn of_a_ray_without_a_record() {
    let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)]).unwrap();
    let builder = Pipeline::builder().hit([program("pass/sphere/closest-hit/main.rchit.spv")]).unwrap();
    let pipeline = builder.build().unwrap();
    let ray = Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]);
    let error = pipeline.trace(&scene, RayOperands::from(ray).sbt(5, 1)).unwrap_err();
    let found = trap(&error);
    assert_eq!((found.code, found.launch_id), (TrapCode::HitRecordMissing, [0, 0, 0]));
    // No shader runs: the host traces.
    assert_eq!((found.stage(), found.line(), found.stack.len()), (None, None, 0));
    let TrapOperands::Record { table, index, records, .. } = found.operands else { panic!("{found:?}") };
    assert_eq!((table, index, records, found.fault_value), ("hit", 5, 1, 5));
}

#[test]
fn of_a_shader_that_a_ray_calls() {
    // A closest-hit shader between two walls that traces at every hit, in line 11. The host's trace
    // has depth 1; the third shader's would have depth 4.
    let wall = |z: f32| Instance::triangle([[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]]);
    let scene = Scene::new([wall(-1.0), wall(1.0)]).unwrap().bind(0, 0);
    let builder = Pipeline::builder().hit([program("fail/trace/recursion/main.rchit.spv")]).unwrap();
    let builder = builder.miss(program("fail/trace/recursion/main.rmiss.spv")).unwrap();
    let pipeline = builder.max_recursion(3).build().unwrap();
    let error = pipeline.trace(&scene, Ray::new([0.0; 3], [0.0, 0.0, -1.0])).unwrap_err();
    let found = trap(&error);
    assert_eq!(found.code, TrapCode::RecursionTooDeep);
    assert_eq!(found.stack.len(), 3, "{found:?}");
    found.stack.iter().for_each(|frame| is_at(frame, Stage::ClosestHit, "recursion/main.rchit", 11));
    let TrapOperands::Limit { key, value, .. } = found.operands else { panic!("{found:?}") };
    assert_eq!((key, value), ("max_recursion_depth", 3.0));
}

#[test]
fn of_a_scene() {
    let error = launched("trace/recursion");
    let found = trap(&error);
    assert_eq!((found.code, found.launch_id), (TrapCode::RecursionTooDeep, [0, 0, 0]));
    let [third, second, first, raygen] = &found.stack[..] else { panic!("{found:?}") };
    for frame in [third, second, first] {
        is_at(frame, Stage::ClosestHit, "recursion/main.rchit", 11);
    }
    // The ray generation shader has no debug information.
    assert_eq!((raygen.stage, raygen.line, &raygen.file), (Stage::RayGeneration, None, &None));
    assert!(raygen.word.is_some() && raygen.shader != first.shader, "{found:?}");

    let error = launched("trace/invalid-ray");
    let found = trap(&error);
    assert_eq!((found.code, found.line()), (TrapCode::InvalidTrace, Some(20)));
    assert_eq!(found.vuid.as_deref(), Some("VUID-RuntimeSpirv-OpTraceRayKHR-06358"));
    let TrapOperands::Ray { rule, .. } = found.operands else { panic!("{found:?}") };
    assert!(rule.contains("NaN"), "{rule}");

    let error = launched("trace/payload-mismatch/any-hit");
    let found = trap(&error);
    assert_eq!((found.code, found.line()), (TrapCode::PayloadMismatch, Some(14)));
    assert_eq!(found.vuid.as_deref(), Some("VUID-RuntimeSpirv-OpTraceRayKHR-11855"));
    let TrapOperands::Callee { shader, stage, entry_point, .. } = &found.operands else {
        panic!("{found:?}")
    };
    assert_eq!((*stage, &**entry_point), (Stage::AnyHit, "main"));
    assert_ne!(*shader, found.stack[0].shader);
}

#[test]
fn of_a_device_address() {
    // The second node would lie 24 bytes behind the 16 bytes of `first`, the only buffer that it
    // can be said to belong to.
    let text = "version = 1\npush_constants = [{ address_of = 'first' }, { u64 = 0 }]\n\
        shaders.main = 'tests/scenes/addresses/nodes.spv'\n[[dispatch]]\nshader = 'main'\n\
        [resources.out]\ntype = 'storage_buffer'\nbinding = 0\nsize = 24\n\
        [resources.first]\ntype = 'buffer'\naddress = 0x10_0000\n\
        data = [{ u32 = [3, 0] }, { u64 = 0x100028 }]\n";
    let error = LoadedScene::from_text("s.toml", text).unwrap().launch().unwrap_err();
    let found = trap(&error);
    assert_eq!((found.code, found.fault_value), (TrapCode::AddressOutOfBounds, 0x10_0028));
    let TrapOperands::Address { address, bytes, start, size, buffer, descriptor, .. } = &found.operands
    else {
        panic!("{found:?}")
    };
    assert_eq!((*address, *bytes), (0x10_0028, Some(4)));
    assert_eq!((buffer.as_deref(), *start, *size), (Some("first"), Some(0x10_0000), Some(16)));
    assert_eq!(*descriptor, None);
}

#[test]
fn of_a_report_in_json() {
    let report = serde_json::to_value(ErrorReport::of(&launched("memory/out-of-bounds"))).unwrap();
    let trap = &report["trap"];
    assert_eq!(trap["code"], "buffer_out_of_bounds");
    assert_eq!(trap["stage"], "RayGenerationKHR");
    assert_eq!(trap["launch_id"], serde_json::json!([5, 0, 0]));
    assert_eq!((&trap["line"], &trap["stack"][0]["line"]), (&11.into(), &11.into()));
    assert_eq!(trap["operands"]["kind"], "buffer");
    assert_eq!(trap["operands"]["offset"], 20);
    assert_eq!(trap["operands"]["descriptor"]["binding"], 2);
    assert_eq!(trap["operands"]["length"], 5);
    assert_eq!(trap["vuid"], serde_json::Value::Null);
}

#[test]
fn each_code_is_told_in_the_guide() {
    let guide = include_str!("../../docs/testing.md");
    let missing: Vec<_> = TrapCode::ALL
        .iter()
        .map(|code| code.name())
        .filter(|name| !guide.contains(&format!("`{name}`")))
        .collect();
    assert!(missing.is_empty(), "{missing:?}");
}
