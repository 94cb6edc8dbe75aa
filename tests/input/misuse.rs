//! Arguments that make no sense: each is an error that says so, never a panic.

use std::fmt::Debug;

use anyhit::{
    Buffer, ComputeTest, DeviceBuffers, ErrorKind, Format, Hit, Image, ImageShape, Instance, LoadedScene,
    Module, Pipeline, PipelineBuilder, Program, Ray, RayOperands, Result, Scene, ShaderTest,
};
use anyhit_engine::accel::RayFlags;
use anyhit_engine::machine::{Invocation, Resources, ShaderIndex};
use anyhit_engine::pipeline::{BatchWidth, Compute, Group, HitGroup, Launch, RunOptions, SbtRecord};

fn module(name: &str) -> std::sync::Arc<Module> {
    Module::open(format!("spirv-fixtures/{name}")).expect("a fixture")
}

fn program(name: &str) -> Program {
    Program::of(&module(name), "main").expect("an entry point")
}

const RAYGEN: &str = "fail/memory/array-index/main.rgen.spv";
const CLOSEST_HIT: &str = "pass/sphere/closest-hit/main.rchit.spv";
const INTERSECTION: &str = "pass/intersection/sphere-in-box/main.rint.spv";
const COMPUTE: &str = "pass/compute/prefix-sum/main.comp.spv";

/// That something is refused with this kind, and these words.
#[track_caller]
fn refused<T: Debug>(result: Result<T>, kind: ErrorKind, words: &str) {
    let error = result.expect_err("it makes no sense");
    assert_eq!(error.kind(), kind, "{error:?}");
    assert!(error.render().contains(words), "no `{words}` in: {error:?}");
}

/// That something is refused as a wrong argument, with these words.
#[track_caller]
fn invalid<T: Debug>(result: Result<T>, words: &str) {
    refused(result, ErrorKind::InvalidArgument, words);
}

fn sphere() -> Scene {
    Scene::new([Instance::sphere([0.0; 3], 0.5)]).expect("a scene")
}

fn hits_spheres() -> PipelineBuilder {
    Pipeline::builder().hit([program(CLOSEST_HIT)]).expect("a hit group")
}

fn down() -> Ray {
    Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0])
}

#[test]
fn rays_that_break_a_rule() {
    // The rules of OpTraceRayKHR by their VUIDs; a time has none there.
    let pipeline = hits_spheres().build().unwrap();
    for (ray, words) in [
        (RayOperands::from(Ray::new([f32::NAN, 0.0, 0.0], [0.0, 0.0, 1.0])), "06358"),
        (RayOperands::from(Ray::new([0.0; 3], [0.0, f32::INFINITY, 1.0])), "06355"),
        (RayOperands::from(down().with_interval(-1.0, 1.0)), "06356"),
        (RayOperands::from(down().with_interval(2.0, 1.0)), "06357"),
        (RayOperands::from(down()).flags(RayFlags(1 | 2)), "06893"),
        (RayOperands::from(down()).time(2.0), "time"),
    ] {
        invalid(pipeline.trace(&sphere(), ray), words);
    }
    let hit = || Hit::sphere([0.0; 3], 0.5);
    let test = || ShaderTest::new(&module(CLOSEST_HIT), "main").unwrap();
    invalid(test().hit(hit().ray(Ray::new([f32::NAN, 0.0, 0.0], [0.0, 0.0, 1.0]))).run(), "06358");
    invalid(test().hit(hit().ray(down()).time(-1.0)).run(), "time");
    invalid(test().hit(hit()).run(), "a hit needs its ray");
}

#[test]
fn pipelines_of_parts_that_do_not_fit() {
    let mut builder = Pipeline::builder();
    invalid(
        Pipeline::builder().hit([program(CLOSEST_HIT), program(CLOSEST_HIT)]).map(|_| ()),
        "two shaders of the stage ClosestHitKHR",
    );
    invalid(builder.group(Group::General(ShaderIndex(9))), "no shader 9");
    let hit = HitGroup { any_hit: Some(ShaderIndex(u32::MAX)), ..HitGroup::default() };
    invalid(builder.group(Group::Hit(hit)), "no shader 4294967295");
    refused(
        Pipeline::builder().miss(program(CLOSEST_HIT)).map(|_| ()),
        ErrorKind::InvalidScene,
        "is ClosestHitKHR, not",
    );
    refused(
        Pipeline::builder().callable(program(CLOSEST_HIT)).map(|_| ()),
        ErrorKind::InvalidScene,
        "is ClosestHitKHR, not",
    );
    refused(
        Pipeline::builder().hit([program(RAYGEN)]).map(|_| ()),
        ErrorKind::InvalidScene,
        "RayGenerationKHR",
    );
    for size in [0, 3, 256] {
        invalid(Pipeline::builder().subgroup_size(size).build(), "subgroup");
    }
    invalid(Pipeline::builder().max_callable_depth(0).build(), "max_callable_depth is 0");
}

#[test]
fn pipelines_that_were_changed_since_they_were_built() {
    let built = hits_spheres().build().unwrap();
    let trace = |change: &dyn Fn(&mut Pipeline)| {
        let mut pipeline = built.clone();
        change(&mut pipeline);
        pipeline.trace(&sphere(), down())
    };
    assert!(trace(&|_| ()).is_ok());
    let group = |pipeline: &mut Pipeline| pipeline.sbt.hit[0] = Some(SbtRecord::new(9));
    refused(trace(&group), ErrorKind::InvalidScene, "refers to group 9");
    let kind = |pipeline: &mut Pipeline| pipeline.sbt.miss = vec![Some(SbtRecord::new(0))];
    refused(trace(&kind), ErrorKind::InvalidScene, "miss record 0 refers to group 0, which is a hit group");
    // Group 1 is of the ray generation shader.
    let with_general = |change: &dyn Fn(&mut Pipeline)| {
        let mut pipeline = hits_spheres().ray_generation(program(RAYGEN)).unwrap().build().unwrap();
        change(&mut pipeline);
        pipeline.trace(&sphere(), down())
    };
    assert!(with_general(&|_| ()).is_ok());
    let general = |pipeline: &mut Pipeline| pipeline.sbt.hit[0] = Some(SbtRecord::new(1));
    refused(
        with_general(&general),
        ErrorKind::InvalidScene,
        "hit record 0 refers to group 1, which is not a hit group",
    );
    for (group, words) in [(0, "which is a hit group"), (1, "which is RayGenerationKHR")] {
        let callable = |pipeline: &mut Pipeline| pipeline.sbt.callable = vec![Some(SbtRecord::new(group))];
        let words = format!("callable record 0 refers to group {group}, {words}");
        refused(with_general(&callable), ErrorKind::InvalidScene, &words);
    }
    let nothing = |pipeline: &mut Pipeline| pipeline.sbt.callable = vec![None];
    assert!(with_general(&nothing).is_ok(), "a null record is no group of another kind");
    let members = |hit: HitGroup| trace(&|pipeline| pipeline.groups[0] = Group::Hit(hit));
    let own = Some(ShaderIndex(0));
    for hit in [
        HitGroup { any_hit: own, ..HitGroup::default() },
        HitGroup { intersection: own, ..HitGroup::default() },
    ] {
        refused(members(hit), ErrorKind::InvalidScene, "is ClosestHitKHR, not");
    }
    assert!(members(HitGroup { closest_hit: own, ..HitGroup::default() }).is_ok());
    refused(
        trace(&|pipeline| pipeline.groups[0] = Group::General(ShaderIndex(0))),
        ErrorKind::InvalidScene,
        "is ClosestHitKHR, not RayGenerationKHR or MissKHR or CallableKHR",
    );
    invalid(trace(&|pipeline| pipeline.groups[0] = Group::General(ShaderIndex(9))), "no shader 9");
    invalid(trace(&|pipeline| pipeline.programs.clear()), "no shader 0");
    invalid(trace(&|pipeline| pipeline.subgroup_size = 3), "a subgroup size must be");
    invalid(trace(&|pipeline| pipeline.max_callable_depth = u32::MAX), "max_callable_depth");
}

#[test]
fn shaders_that_do_not_run_by_themselves() {
    let mut builder = Pipeline::builder();
    let shaders = [INTERSECTION, COMPUTE, CLOSEST_HIT].map(|name| builder.shader(program(name)));
    let (pipeline, resources) = (builder.build().unwrap(), Resources::default());
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let invoke = |shader: ShaderIndex| {
        let ended = launch.invoke(shader, Invocation::default(), &[], &[], None, None);
        ended.map(|ended| ended.is_ok())
    };
    invalid(invoke(shaders[0]), "is IntersectionKHR, which cannot run alone");
    invalid(invoke(shaders[1]), "is GLCompute, which cannot run alone");
    invalid(invoke(ShaderIndex(3)), "no shader 3");
    // More words than the payload has are left over.
    let ended = launch.invoke(shaders[2], Invocation::default(), &[0; 99], &[0; 99], None, None);
    assert!(ended.is_ok());
}

#[test]
fn launches_that_are_too_large_or_nothing() {
    let pipeline = Pipeline::builder().ray_generation(program(RAYGEN)).unwrap().build().unwrap();
    let scene = Scene::new([]).unwrap().buffer(0, 1, &[0.0f32; 4]);
    invalid(pipeline.launch(&scene, [4, 0, 1]), "has no invocations");
    invalid(pipeline.launch(&scene, [u32::MAX; 3]), "maxRayDispatchInvocationCount");
    assert!(pipeline.launch(&scene, [4, 1, 1]).is_ok());
    let launch = Launch { pipeline: &pipeline, resources: scene.resources() };
    let one = |id, size| launch.run_one(id, size, None, None);
    assert!(one([3, 0, 0], [4, 1, 1]).is_ok());
    invalid(one([4, 0, 0], [4, 1, 1]), "invocation 4,0,0 is outside the launch of 4 x 1 x 1");
    invalid(one([0, 0, 0], [0, 1, 1]), "outside the launch");
    invalid(one([0, 0, 0], [u32::MAX; 3]), "maxRayDispatchInvocationCount");
    let single = launch.run_single_threaded([u32::MAX; 3], None, None);
    invalid(single.map(|_| ()), "maxRayDispatchInvocationCount");
    refused(
        Pipeline::builder().build().unwrap().launch(&scene, [1, 1, 1]),
        ErrorKind::InvalidScene,
        "nothing to launch",
    );

    let compute = Compute::new(program(COMPUTE)).unwrap();
    let resources = Resources::default();
    invalid(
        compute.run_to_trap(&resources, [u32::MAX; 3], RunOptions::of(BatchWidth::One)).map(|_| ()),
        "2^40 in total",
    );
    let test = ComputeTest::new(&module(COMPUTE), "main").unwrap();
    invalid(test.clone().workgroups([u32::MAX; 3]).run(), "2^40 in total");
    assert!(test.workgroups([0, 1, 1]).run().is_ok());
    invalid(ComputeTest::new(&module(COMPUTE), "main").unwrap().subgroup_size(3), "a subgroup size must be");
}

#[test]
fn numbers_that_no_geometry_has() {
    let wrong =
        |instance: Instance, words: &str| refused(Scene::new([instance]), ErrorKind::InvalidScene, words);
    wrong(Instance::sphere([0.0; 3], -1.0), "radius");
    wrong(Instance::sphere([0.0; 3], 1.0).custom_index(1 << 24), "24 bits");
    wrong(Instance::sphere([0.0; 3], 1.0).sbt_offset(1 << 24), "24 bits");
    wrong(Instance::sphere([0.0; 3], 1.0).transform([[f32::NAN; 4]; 3]), "transform");
    wrong(Instance::triangles([[0.0; 3]; 4]), "the number of vertices (4) is not a multiple of 3");
    wrong(Instance::triangle([[0.0; 3]; 3]).vertices_t1([[0.0; 3]; 2]), "vertices");
    wrong(Instance::sphere([0.0; 3], 1.0).vertices_t1([[0.0; 3]; 3]), "");
    // Chains of no segment and of one point have no primitive to hit.
    assert!(Scene::new([Instance::chain([]), Instance::chain([([0.0; 3], 1.0)])]).is_ok());
}

#[test]
fn sizes_that_no_memory_has() {
    let mut buffers = DeviceBuffers::new();
    invalid(buffers.reserve("huge", usize::MAX), "`buffer-bytes`");
    refused(Image::plane(Format::RGBA32F, 0, 1), ErrorKind::InvalidImage, "has no texels");
    let most = ImageShape::plane(u32::MAX, u32::MAX);
    refused(Image::zeroed(Format::RGBA32F, most), ErrorKind::InvalidImage, "not enough memory");
    let image = Image::plane(Format::RGBA32F, 2, 1).unwrap();
    assert_eq!((image.level_extent(1), image.level_bytes(1)), ([0; 3], Vec::new()));
}

#[test]
fn buffers_load_and_store_no_other_widths() {
    let buffer = Buffer::new(&[1, 2, 3, 4, 5]);
    for width in [0, 1, 12, 24, 33, 64, u32::MAX] {
        for offset in [0, 1, 4, 5, u64::MAX] {
            assert_eq!((buffer.load(offset, width), buffer.store(offset, width, 7)), (None, None));
        }
    }
    assert_eq!(buffer.bytes(), [1, 2, 3, 4, 5]);
    assert_eq!(
        (buffer.load(4, 8), buffer.load(4, 16), buffer.load(1, 32)),
        (Some(5), None, Some(0x0504_0302))
    );
}

#[test]
fn shaders_and_passes_that_a_scene_does_not_have() {
    let mut scene = LoadedScene::open("shaders/fail/memory/array-index/scene.toml").unwrap();
    invalid(scene.launch_pass("no-such"), "no-such");
    invalid(scene.transform(7), "instance 7");
    let spirv = std::fs::read(format!("spirv-fixtures/{RAYGEN}")).unwrap();
    invalid(scene.set_shader_spirv("no-such", &spirv).map(|_| ()), "no-such");
    assert!(scene.set_shader_spirv("raygen", &spirv).unwrap().launch().unwrap_err().trap().is_some());
    let broken = scene.set_shader_spirv("raygen", &spirv[..64]).unwrap().launch();
    assert!(broken.unwrap_err().message().contains("the module ends after"));
}

#[test]
fn images_are_read_where_they_are_bound() -> Result<()> {
    let builder = Pipeline::builder().ray_generation(program("pass/images/out-of-bounds/main.rgen.spv"))?;
    let format = Format::new(anyhit::Component::Float32, 1);
    let mut scene = Scene::new([])?.image(0, 1, Image::plane(format, 3, 1)?);
    let _ = builder.build()?.launch_mut(&mut scene, [3, 1, 1])?;
    // Each invocation stores 1; what the format lacks is 0, and A is 1.
    assert_eq!(scene.read_image(0, 1)?.rows(), [[[1.0, 0.0, 0.0, 1.0]; 3]]);
    invalid(scene.read_image(0, 2), "no image is bound");
    Ok(())
}

#[cfg(feature = "wgsl")]
#[test]
fn vectors_are_read_as_what_they_are() -> Result<()> {
    let source = "
        struct Params { at: vec2f, cells: vec3u, steps: vec2i }
        @group(0) @binding(0) var<storage, read_write> params: Params;
        @compute @workgroup_size(1)
        fn main() { params.at.x = f32(params.cells.x) + f32(params.steps.y); }
    ";
    let module = Module::from_source("params.wgsl", source)?;
    let data = anyhit::StructData::of(&module, "Params")?
        .set("at", [0.5, -1.5])?
        .set("cells", [7u32, 8, u32::MAX])?
        .set("steps", [-3, 4])?;
    let value = data.value();
    assert_eq!(value["at"].vec2(), [0.5, -1.5]);
    assert_eq!(value["cells"].uvec::<3>(), [7, 8, u32::MAX]);
    assert_eq!(value["steps"].ivec::<2>(), [-3, 4]);
    invalid(anyhit::StructData::of(&module, "Params")?.set("cells", [7u32, 8]), "cells");
    Ok(())
}
