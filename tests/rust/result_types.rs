//! What runs leave behind, taken by functions that a test of one's own would have: by its types.

use anyhit::{
    CompareOp, ComputeOutcome, ComputeTest, Filter, Hit, HitRecord, Instance, Launched, Module, Pipeline,
    PrintedLine, Program, Ray, ReportedHit, Result, Sampler, Sbt, SbtRecord, Scene, ShaderTest, StructData,
    Traced, Warning,
};

/// The texts in the order of the launch.
fn texts(lines: &[PrintedLine]) -> Vec<&str> {
    lines.iter().map(|line| line.text.as_str()).collect()
}

fn halves(outcome: &ComputeOutcome) -> Result<Vec<[f32; 2]>> {
    outcome.read_buffer(0, 1)
}

#[test]
fn a_compute_shader_leaves_buffers_and_lines() -> Result<()> {
    let module = Module::open("spirv-fixtures/pass/compute/print/main.comp.spv")?;
    let warnings: &[Warning] = &module.warnings;
    assert!(warnings.is_empty(), "{warnings:?}");
    let constants = StructData::push_constants(&module)?.set("scale", 3.0)?;
    let test = ComputeTest::new(&module, "main")?.buffer(0, 1, &[[0.0_f32; 2]; 2]);
    let outcome = test.push_constants_data(&constants).run()?;
    // halves[at] = vec2(at, scale) / 2, for the two invocations of a workgroup.
    assert_eq!(halves(&outcome)?, [[0.0, 1.5], [0.5, 1.5]]);
    assert_eq!(texts(&outcome.printed).len(), 1);
    Ok(())
}

/// The nearest report that was accepted.
fn nearest(reports: &[ReportedHit]) -> Option<f32> {
    reports.iter().filter(|report| report.accepted).map(|report| report.t).min_by(f32::total_cmp)
}

/// A sphere of radius 1 at the origin: its roots are at 5 - 1 and at 5 + 1.
#[test]
fn an_intersection_shader_reports_both_roots() -> Result<()> {
    let module = Module::open("spirv-fixtures/pass/intersection/sphere-in-box/main.rint.spv")?;
    let hit = Hit::aabb([-1.0; 3], [1.0; 3]).ray(Ray::new([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]));
    let spheres = [[0.0_f32, 0.0, 0.0, 1.0]; 4];
    let outcome = ShaderTest::new(&module, "main")?.hit(hit).shader_record(&spheres).run()?;
    assert_eq!(
        outcome.reports.iter().map(|report| (report.t, report.kind)).collect::<Vec<_>>(),
        [(6.0, 6), (4.0, 5)]
    );
    assert_eq!(nearest(&outcome.reports), Some(4.0));
    Ok(())
}

/// Two more records of the first hit group, the second without data.
fn share_the_first_group(table: &mut Sbt) {
    let group = table.hit[0].as_ref().map_or(0, |record| record.group);
    table.hit.push(Some(SbtRecord::with_data(group, &1.0_f32.to_le_bytes())));
    table.hit.push(Some(SbtRecord::new(group)));
}

fn distance(traced: &Traced) -> Option<f32> {
    let hit: HitRecord = if traced.missed() { return None } else { traced.hit() };
    Some(hit.t)
}

/// With offset 2 in the table, the sphere's record is the third.
#[test]
fn a_record_without_data_of_a_shared_group_runs_the_same_shader() -> Result<()> {
    let folder = "spirv-fixtures/pass/sphere/closest-hit";
    let shader = |file| Program::of(&Module::open(format!("{folder}/{file}"))?, "main");
    let mut builder =
        Pipeline::builder().hit([shader("main.rchit.spv")?])?.miss(shader("main.rmiss.spv")?)?;
    share_the_first_group(builder.sbt());
    let pipeline = builder.build()?;
    let scene = Scene::new([Instance::sphere([0.0; 3], 0.5).sbt_offset(2)])?;
    let through = |x| pipeline.trace(&scene, Ray::new([x, 0.0, 4.0], [0.0, 0.0, -1.0]));
    // The sphere's surface is at z = 1/2.
    assert_eq!(distance(&through(0.0)?), Some(3.5));
    assert_eq!(through(0.0)?.payload["t"].f32(), 3.5);
    assert_eq!(distance(&through(0.75)?), None);
    Ok(())
}

/// Rays of a launch, and how many of them ran a shader of ray generation.
fn rays(launched: &Launched) -> u64 {
    launched.stats.rays
}

/// The shader takes square roots of what it is given: binding 2 in, binding 1 out.
#[test]
fn a_launch_without_traces_has_no_rays() -> Result<()> {
    let module = Module::open("spirv-fixtures/pass/arithmetic/elementary/main.rgen.spv")?;
    let pipeline = Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.build()?;
    let inputs = [[4.0_f32, 0.0, 0.0, 0.0], [9.0, 0.0, 0.0, 0.0]];
    let scene = Scene::new([])?.buffer(0, 2, &inputs).buffer(0, 1, &[[0.0_f32; 4]; 16]);
    let launched = pipeline.launch(&scene, [2, 1, 1])?;
    assert_eq!((rays(&launched), launched.stats.invocations(anyhit::Stage::RayGeneration)), (0, 2));
    Ok(())
}

/// A sampler that compares, as of a shadow map, is a value that tests can share.
#[test]
fn a_sampler_may_compare() {
    let shadow =
        Sampler { mag_filter: Filter::Linear, compare_op: Some(CompareOp::Less), ..Sampler::default() };
    assert_eq!(shadow.compare_op, Some(CompareOp::Less));
    assert_ne!(shadow, Sampler::default());
}
