//! Tests of a single shader: what they can set, and what their mistakes are answered with.

use std::sync::Arc;

use crate::hit::Hit;
use crate::instance::Instance;
use crate::shader_test::ShaderTest;
use anyhit_base::error::ErrorKind;
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine::Exit;
use anyhit_engine::module::Module;

fn fixture(name: &str) -> Arc<Module> {
    let root =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("spirv-fixtures/pass");
    Module::open(root.join(name)).expect("a fixture")
}

fn sphere() -> ShaderTest {
    ShaderTest::new(&fixture("sphere/closest-hit/main.rchit.spv"), "main").expect("a closest-hit shader")
}

fn front() -> Hit {
    Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -2.0]))
}

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Payload {
    normal: [f32; 3],
    t: f32,
    hits: u32,
}

#[test]
fn a_payload_goes_in_and_out_as_a_rust_struct_and_by_name() {
    let before = Payload { normal: [9.0; 3], t: 9.0, hits: 41 };
    let outcome = sphere().hit(front()).payload(&before).run().unwrap();
    // (4 - 1/2) / 2
    let expected = Payload { normal: [0.0, 0.0, 1.0], t: 1.75, hits: 42 };
    assert_eq!(outcome.payload::<Payload>().unwrap(), expected);
    assert_eq!(outcome.payload["normal"].vec3(), expected.normal);
    assert_eq!(outcome.payload["hits"].u32(), 42);
    assert_eq!(outcome.exit, Exit::Returned);
}

#[test]
fn a_builtin_takes_any_value() {
    let outcome = sphere().hit(front()).builtin("HitSphereRadius", 2.0f32).run().unwrap();
    assert_eq!(outcome.payload["normal"].vec3(), [0.0, 0.0, 0.25]);
    let outcome = sphere()
        .builtin("ObjectRayOriginKHR", [3.0f32, 0.0, 0.0])
        .builtin("HitSphereRadiusNV", 1.0f32)
        .builtin("RayTmaxKHR", 7.0f32)
        .run()
        .unwrap();
    assert_eq!(outcome.payload["normal"].vec3(), [3.0, 0.0, 0.0]);
    assert_eq!(outcome.payload["t"].f32(), 7.0);
}

#[test]
fn mistakes_are_told_with_both_sides() {
    let error = |test: ShaderTest| test.run().unwrap_err().render();
    let text = error(sphere().hit(front()).payload(&[0.0f32; 4]));
    assert!(text.contains("`[f32; 4]` has 16 bytes, but the shader's struct Payload has 20 bytes"), "{text}");
    assert!(text.contains("12  float t"), "{text}");
    assert!(text.contains("16  uint hits"), "{text}");
    let text = error(sphere().builtin("HitSphereRadiusNV", 1u32));
    assert!(text.contains("HitSphereRadiusNV: 1 is an integer, not a float: write `1.0`"), "{text}");
    let text = error(sphere().builtin("HitSphereRadiusNV", [1.0f32; 2]));
    assert!(text.contains("HitSphereRadiusNV is a 32-bit float, not [float; 2]"), "{text}");
    let text = error(sphere().builtin("HitSphereRadus", 1.0f32));
    assert!(text.contains("did you mean `HitSphereRadiusNV`?"), "{text}");
    let text = error(sphere().hit(Hit::sphere([9.0; 3], 0.5).ray(Ray::new([0.0; 3], [1.0, 0.0, 0.0]))));
    assert!(text.contains("the ray misses the primitive"), "{text}");
    let text = error(sphere().hit(Hit::sphere([9.0; 3], 0.5)));
    assert!(text.contains("a hit needs its ray"), "{text}");
    let text = error(sphere().attributes(&1.0f32));
    assert!(text.contains("does not use the given hit attributes"), "{text}");
    let text = ShaderTest::new(&fixture("sphere/closest-hit/main.rchit.spv"), "mian").unwrap_err().render();
    assert!(text.contains("did you mean `main`?"), "{text}");
}

#[test]
fn any_hit_shaders_ignore_and_terminate() {
    let test =
        |name: &str| ShaderTest::new(&fixture(&format!("any-hit/ignore-and-terminate/{name}")), "main");
    let run = |name: &str, primitive: u32| {
        test(name).unwrap().builtin("PrimitiveId", primitive).payload(&[5u32, 5, 0, 0]).run().unwrap()
    };
    let ignored = run("ignore.rahit.spv", 2);
    assert_eq!(ignored.exit, Exit::Ignored);
    // What the payload got before the ignore counts.
    assert_eq!((ignored.payload["seen"].u32(), ignored.payload["ignored"].u32()), (6, 6));
    assert_eq!(run("ignore.rahit.spv", 3).exit, Exit::Returned);
    assert_eq!(run("terminate.rahit.spv", 3).exit, Exit::Terminated);
    assert_eq!(run("terminate.rahit.spv", 0).exit, Exit::Ignored);
}

#[test]
fn an_intersection_shader_reports() {
    let module = fixture("intersection/sphere-in-box/main.rint.spv");
    let hit = Hit::aabb([-1.0; 3], [1.0; 3]).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let test = ShaderTest::new(&module, "main").unwrap().hit(hit);
    let test = test.shader_record(&[[0.0f32, 0.0, 0.0, 1.0], [0.0; 4], [0.0; 4], [0.0; 4]]);
    let outcome = test.run().unwrap();
    let found: Vec<_> =
        outcome.reports.iter().map(|report| (report.t, report.kind, report.accepted)).collect();
    assert_eq!(found, [(5.0, 6, true), (3.0, 5, true)]);
    assert_eq!(outcome.reports[1].attributes["normal"].vec3(), [0.0, 0.0, 1.0]);
    // The far root lies behind the ray's end.
    let hit = Hit::aabb([-1.0; 3], [1.0; 3])
        .ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]).with_interval(0.0, 4.0));
    let outcome = test.clone().hit(hit).run().unwrap();
    assert_eq!(outcome.reports.iter().map(|report| report.accepted).collect::<Vec<_>>(), [false, true]);
    assert!(test.reject_reports().run().unwrap().reports.iter().all(|report| !report.accepted));
}

#[test]
fn a_record_without_data_is_not_called_missing() {
    let module = fixture("intersection/sphere-in-box/main.rint.spv");
    let hit = Hit::aabb([-1.0; 3], [1.0; 3]).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let text = ShaderTest::new(&module, "main").unwrap().hit(hit).run().unwrap_err().render();
    assert!(text.contains("the shader record holds no data: nothing follows its handle"), "{text}");
    assert!(!text.contains("no such record"), "{text}");
}

#[test]
fn buffers_are_read_by_name_and_checked() {
    let module = fixture("arithmetic/elementary/main.rgen.spv");
    let test = ShaderTest::new(&module, "main").unwrap().buffer(0, 2, &[[4.0f32, 0.0, 0.0, 0.0]]);
    let outcome = test.clone().buffer(0, 1, &[[0.0f32; 4]; 8]).run().unwrap();
    let outputs = outcome.buffer(0, 1).unwrap();
    // sqrt(4.5), 1 / sqrt(4.5), fract(4), floor(4)
    assert_eq!(outputs["outputs"][0][3].vec4(), [4.5f32.sqrt(), (1.0 / 4.5f64.sqrt()) as f32, 0.0, 4.0]);
    assert_eq!(outputs.read_all::<[f32; 4]>().unwrap()[3][3], 4.0);
    let text = test.buffer(0, 1, &[[0.0f32; 4]; 9]).run().unwrap_err().render();
    assert!(text.contains("has 144 bytes") && text.contains("0 bytes and 128 for each element"), "{text}");
}

/// `payload/structs/main.rchit`: writes its own bounce, then traces on with the payload.
fn bouncing() -> ShaderTest {
    let hit = Hit::triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let hit = hit.ray(Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]));
    ShaderTest::new(&fixture("payload/structs/main.rchit.spv"), "main").unwrap().hit(hit)
}

#[test]
fn a_trace_that_nothing_answers_leaves_the_payload() {
    let outcome = bouncing().run().unwrap();
    assert_eq!(outcome.traces.len(), 1);
    assert_eq!(outcome.traces[0].given, outcome.traces[0].payload.value());
}

#[test]
fn a_trace_is_answered_by_a_closure() {
    let outcome = bouncing()
        .on_trace(|trace| {
            assert_eq!(trace.given["bounces"][0]["at"].vec3(), [0.25, 0.25, 0.0]);
            trace.payload.set("counts", [5, -6])?;
            trace.payload.set("bounces[2].at", [7.0f32, 8.0, 9.0])
        })
        .run()
        .unwrap();
    let [trace] = &outcome.traces[..] else { panic!("{:?}", outcome.traces) };
    // The hit lies at z = 0, and the shader's own source traces on from there.
    assert_eq!((trace.number, trace.trace.ray.origin), (0, [0.25, 0.25, 0.0]));
    assert_eq!(trace.payload.value()["counts"].ivec::<2>(), [5, -6]);
    assert_eq!(outcome.payload["bounces"][2]["at"].vec3(), [7.0, 8.0, 9.0]);
}

#[test]
fn answers_in_turn_run_out_loudly_and_must_fit() {
    // 92 bytes: see the shader's struct.
    let answer = [0u32; 23];
    assert_eq!(bouncing().trace_answers(&[answer]).run().unwrap().traces.len(), 1);
    let text = bouncing().trace_answers(&[answer; 0]).run().unwrap_err().render();
    assert!(text.contains("trace 1") && text.contains("0 answers"), "{text}");
    let text = bouncing().trace_answers(&[[0u32; 3]]).run().unwrap_err().render();
    assert!(text.contains("has 12 bytes, but the shader's struct Payload has 92 bytes"), "{text}");
    let text = bouncing().on_trace(|trace| trace.payload.set("bounces[3].at", 1.0f32)).run().unwrap_err();
    assert!(text.message().contains("no element `bounces[3]`"), "{text:?}");
    let text = bouncing().on_trace(|trace| trace.payload.set("depth", 1.0f32)).run().unwrap_err();
    assert!(text.message().contains("1.0 is a float, not uint"), "{text:?}");
}

#[test]
fn types_that_differ_are_shown_side_by_side() {
    #[repr(C)]
    #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
    struct Swapped {
        hits: u32,
        normal: [f32; 3],
        t: f32,
    }
    let given: Swapped = bytemuck::Zeroable::zeroed();
    let text = sphere().hit(front()).payload(&given).run().unwrap_err().render();
    assert!(
        text.contains("the scalars of `Swapped` differ from those of the shader's struct Payload"),
        "{text}"
    );
    let row = |left: &str, right: &str| {
        text.lines().any(|line| line.contains(left) && line.trim_end().ends_with(right))
    };
    assert!(row("     0  vec3 normal", "hits: integer"), "{text}");
    assert!(row("     4 ", "normal: [float; 3]"), "{text}");
    assert!(row("    16  uint hits", "t: float"), "{text}");
    let outcome = sphere().hit(front()).run().unwrap();
    assert!(outcome.payload::<Swapped>().is_err());
}

#[test]
fn a_payload_is_set_by_the_names_of_its_members() {
    let outcome = sphere().hit(front()).payload_member("hits", 41u32).run().unwrap();
    assert_eq!(outcome.payload["hits"].u32(), 42);
    let text = sphere().hit(front()).payload_member("hit", 41u32).run().unwrap_err().render();
    assert!(text.contains("no member `hit`") && text.contains("16  uint hits"), "{text}");
}

/// The ray generation shader of `trace-and-execute`: traces into a hit object, asks it, executes
/// it.
fn objects() -> ShaderTest {
    let module = fixture("hit-object/trace-and-execute/main.rgen.spv");
    let test = ShaderTest::new(&module, "main").expect("a ray generation shader");
    test.buffer(0, 1, &[[0.0f32; 16]])
}

#[test]
fn a_trace_into_a_hit_object_finds_what_the_answer_says() {
    let triangle = Instance::triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).sbt_offset(3);
    let outcome = objects()
        .on_trace(move |trace| {
            assert!(trace.into_hit_object);
            trace.hit(triangle.clone());
            trace.payload.set("[0]", 5.0f32)
        })
        .on_execute(|call| {
            assert_eq!(call.hit.map(|hit| (hit.t, hit.primitive)), Some((4.0, 0)));
            assert_eq!(call.given[0].f32(), 5.0);
            call.payload.set("", [5.0f32, 6.0, 7.0, 8.0])
        })
        .run()
        .unwrap();
    let row = &outcome.buffer(0, 1).unwrap()["outputs"][0];
    let found: Vec<f32> = (0..14).map(|at| row[at].f32()).collect();
    // Not empty, a hit, no miss; the payload; the interval ends at the hit; record 3 + 0 x 1 + 1;
    // the ray at (1/4, 1/4); a front-facing triangle (HitKindFrontFacingTriangleKHR is 0xFE).
    let expected = [0.0, 1.0, 0.0, 5.0, 0.5, 4.0, 4.0, 0.25, 0.25, 254.0, 5.0, 6.0, 7.0, 8.0];
    assert_eq!(found, expected);
    assert_eq!((outcome.traces.len(), outcome.executes.len(), outcome.executes[0].record), (1, 1, 4));
}

#[test]
fn a_hit_object_without_an_instance_is_a_miss() {
    let beside = Instance::sphere([9.0, 0.0, 0.0], 0.5);
    for instance in [None, Some(beside)] {
        let outcome = objects()
            .on_trace(move |trace| {
                if let Some(instance) = instance.clone() {
                    trace.hit(instance);
                }
                Ok(())
            })
            .execute_answers(&[[2.0f32; 4]])
            .run()
            .unwrap();
        let row = &outcome.buffer(0, 1).unwrap()["outputs"][0];
        // The miss index is 1, the interval the ray's own.
        let found = [0, 1, 2, 4, 5, 6, 13].map(|at| row[at].f32());
        assert_eq!(found, [0.0, 0.0, 1.0, 0.5, 100.0, 1.0, 2.0]);
        assert_eq!(outcome.executes[0].hit, None);
    }
}

#[test]
fn the_record_of_a_hit_object_is_what_the_test_gives() {
    let module = fixture("hit-object/getters/main.rgen.spv");
    // Its ray goes down from (3/2, 9/4, 1).
    let triangle = Instance::triangle([[1.0, 2.0, -3.0], [3.0, 2.0, -3.0], [1.0, 4.0, -3.0]]);
    let test = ShaderTest::new(&module, "main").expect("a ray generation shader");
    let test = test.buffer(0, 1, &[0.0f32; 55]).on_trace(move |trace| {
        trace.hit(triangle.clone());
        Ok(())
    });
    // The shader reads the number behind the record's handle last.
    let outcome = test.clone().hit_object_record(&29.5f32).run().unwrap();
    assert_eq!(outcome.buffer(0, 1).unwrap()["outputs"][54].f32(), 29.5);
    // A record of no bytes is there, and holds no number.
    let error = test.clone().hit_object_record(&[0u32; 0]).run().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Trap);
    let error = test.run().unwrap_err().render();
    assert!(error.contains("reads the shader record of a hit object"), "{error}");
    assert!(error.contains(".hit_object_record(&data)"), "{error}");
}

#[test]
fn hit_objects_that_nothing_answers_leave_the_payload() {
    let outcome = objects().run().unwrap();
    assert_eq!((outcome.traces.len(), outcome.executes.len()), (1, 1));
    assert_eq!(outcome.executes[0].given, outcome.executes[0].payload.value());
    let test = objects().on_trace(|_| Ok(())).execute_answers::<[f32; 4]>(&[]);
    let error = test.run().unwrap_err().render();
    assert!(error.contains("the shader makes execution 1, but there are only 0 answers"), "{error}");
}
