//! Outcomes are values: what a run leaves behind is in what it returns. The scene or test that it
//! was given, clones of it, the images and buffers bound to it, and earlier outcomes stay as they
//! are, and nothing that no shader writes is copied.

use std::sync::Arc;

#[cfg(feature = "glsl")]
use anyhit::SbtRecord;
use anyhit::{
    Buffer, Component, ComputeTest, Descriptor, ErrorKind, Explain, Format, Image, ImageShape, Instance,
    LoadedScene, Module, Pipeline, PrintedLine, Program, Ray, Result, Sampler, Scene, ShaderTest,
    StreamedImage,
};

const TRIANGLE: [[f32; 3]; 3] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
const COUNT: Format = Format::new(Component::Uint32, 1);

fn down() -> Ray {
    Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0])
}

/// A pipeline that adds to each number of the buffer at binding 0 its index, counted from 1, and
/// stores the sum, and 2^24 + 1, in the image at binding 1.
fn accumulate() -> Result<Pipeline> {
    let module = Module::open("spirv-fixtures/pass/harness/conversions/accumulate.rgen.spv")?;
    Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.build()
}

/// A scene for [`accumulate`], whose numbers are 0.
fn zeros(image: &Arc<Image>) -> Result<Scene> {
    Ok(Scene::new([])?.buffer(0, 0, &[0u32; 4]).image(0, 1, image.clone()))
}

/// A pipeline of one ray generation shader of these variables; the body finds the launch index
/// `id`.
fn ray_generation(variables: &str, body: &str) -> Result<Pipeline> {
    let source = format!(
        "enable wgpu_ray_tracing_pipeline;
         {variables}
         @ray_generation fn main(@builtin(ray_invocation_id) id: vec3u) {{ {body} }}"
    );
    let module = Module::from_source("outcomes.wgsl", &source)?;
    Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.build()
}

/// A compute shader of these variables; the body finds the index `at` of two invocations.
fn compute(variables: &str, body: &str) -> Result<ComputeTest> {
    let source = format!(
        "{variables}
         @compute @workgroup_size(2) fn main(@builtin(local_invocation_index) at: u32) {{ {body} }}"
    );
    ComputeTest::new(&Module::from_source("outcomes.wgsl", &source)?, "main")
}

#[test]
fn a_launch_leaves_everything_but_its_outcome() -> Result<()> {
    let (pipeline, image) = (accumulate()?, Image::plane(COUNT, 2, 2)?);
    let scene = zeros(&image)?;
    let clone = scene.clone();
    let first = pipeline.launch(&scene, [2, 2, 1])?;
    let second = pipeline.launch(&scene, [2, 1, 1])?;
    let third = pipeline.launch(&clone, [2, 2, 1])?;
    assert_eq!(first.read_buffer::<u32>(0, 0)?, [1, 2, 3, 4]);
    assert_eq!(second.read_buffer::<u32>(0, 0)?, [1, 2, 0, 0]);
    assert_eq!(third.read_buffer::<u32>(0, 0)?, [1, 2, 3, 4]);
    let texel = |sum: u32| (16_777_217 + sum).to_le_bytes();
    assert_eq!(first.image(0, 1)?.image().bytes(), [1, 2, 3, 4].map(texel).concat());
    for scene in [&scene, &clone] {
        assert_eq!(scene.read_buffer::<u32>(0, 0)?, [0; 4]);
        assert_eq!(scene.read_image(0, 1)?.image().bytes(), [0; 16]);
    }
    assert_eq!(image.bytes(), [0; 16]);
    Ok(())
}

#[test]
fn a_launch_that_keeps_its_writes_accumulates() -> Result<()> {
    let (pipeline, image) = (accumulate()?, Image::plane(COUNT, 2, 2)?);
    let mut scene = zeros(&image)?;
    let before = scene.clone();
    let first = pipeline.launch_mut(&mut scene, [2, 2, 1])?;
    let between = scene.clone();
    let second = pipeline.launch_mut(&mut scene, [2, 2, 1])?;
    assert_eq!(first.read_buffer::<u32>(0, 0)?, [1, 2, 3, 4]);
    assert_eq!(second.read_buffer::<u32>(0, 0)?, [2, 4, 6, 8]);
    for (scene, numbers) in [(&before, [0; 4]), (&between, [1, 2, 3, 4]), (&scene, [2, 4, 6, 8])] {
        assert_eq!(scene.read_buffer::<u32>(0, 0)?, numbers);
    }
    let texel = |sum: u32| (16_777_217 + sum).to_le_bytes();
    assert_eq!(scene.read_image(0, 1)?.image().bytes(), [2, 4, 6, 8].map(texel).concat());
    assert_eq!(image.bytes(), [0; 16]);
    Ok(())
}

#[test]
fn threads_launch_on_one_scene_at_once() -> Result<()> {
    let (pipeline, scene) = (accumulate()?, zeros(&Image::plane(COUNT, 2, 2)?)?);
    let launches = || (0..20).map(|_| pipeline.launch(&scene, [2, 2, 1])?.read_buffer::<u32>(0, 0));
    std::thread::scope(|scope| {
        let threads = [(); 4].map(|()| scope.spawn(|| launches().collect::<Result<Vec<_>>>()));
        for thread in threads {
            let outcomes = thread.join().expect("no panic")?;
            assert_eq!(outcomes, vec![vec![1, 2, 3, 4]; 20]);
        }
        Ok(())
    })
}

/// Pixels of the case that see several leaves print a line.
#[test]
fn threads_have_their_own_printed_lines() -> Result<()> {
    let (pipeline, scene) = LoadedScene::open("shaders/pass/testing/leaves/scene.toml")?.pipeline()?;
    let launch = || pipeline.launch(&scene, [3, 1, 1]);
    let texts = |lines: &[PrintedLine]| lines.iter().map(|line| line.text.clone()).collect::<Vec<_>>();
    let alone = texts(&launch()?.printed);
    assert!(!alone.is_empty());
    std::thread::scope(|scope| {
        for thread in [(); 4].map(|()| scope.spawn(|| (0..5).map(|_| launch()).collect::<Result<Vec<_>>>())) {
            for outcome in thread.join().expect("no panic")? {
                assert_eq!(texts(&outcome.printed), alone);
            }
        }
        Ok(())
    })
}

/// Invocations 0 to 3 write, and the fourth indexes an array outside of its bounds.
#[test]
fn a_trap_changes_nothing() -> Result<()> {
    let module = Module::open("spirv-fixtures/fail/memory/array-index/main.rgen.spv")?;
    let pipeline = Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.build()?;
    let mut scene = Scene::new([])?.buffer(0, 1, &[-1.0f32; 6]);
    for error in [pipeline.launch(&scene, [6, 1, 1]), pipeline.launch_mut(&mut scene, [6, 1, 1])] {
        assert_eq!(error.expect_err("a trap").kind(), ErrorKind::Trap);
        assert_eq!(scene.read_buffer::<f32>(0, 1)?, [-1.0; 6]);
    }
    let _ = pipeline.launch_mut(&mut scene, [2, 1, 1])?;
    assert_eq!(scene.read_buffer::<f32>(0, 1)?, [1.5, 2.5, -1.0, -1.0, -1.0, -1.0]);
    Ok(())
}

#[test]
fn a_trap_of_a_compute_shader_changes_nothing() -> Result<()> {
    let variables = "@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;";
    let mut test = compute(variables, "numbers[at] += 1u; if numbers[at] == 3u { numbers[at + 9u] = 0u; }")?
        .buffer(0, 0, &[1u32, 1]);
    assert_eq!(test.run_mut()?.read_buffer::<u32>(0, 0)?, [2, 2]);
    for _ in 0..2 {
        assert_eq!(test.run_mut().expect_err("a trap").kind(), ErrorKind::Trap);
    }
    Ok(())
}

/// Memory that two bindings share is shared in the outcome, too.
#[test]
fn views_of_one_buffer_see_each_others_writes() -> Result<()> {
    let pipeline = ray_generation(
        "@group(0) @binding(0) var<storage, read_write> written: array<u32>;
         @group(0) @binding(1) var<storage, read> seen: array<u32>;
         @group(0) @binding(2) var<storage, read_write> found: array<u32>;",
        "written[id.x] = 7u + id.x; found[id.x] = seen[id.x];",
    )?;
    let arena = Buffer::new(bytemuck::cast_slice(&[1u32, 2, 3, 4]));
    let view = |offset, bytes| Descriptor::Buffer(arena.view(offset, bytes, "arena").expect("a range"));
    let mut scene = Scene::new([])?
        .descriptor(0, 0, view(4, 8))
        .descriptor(0, 1, view(4, 12))
        .descriptor(0, 3, Descriptor::Buffer(arena.clone()))
        .buffer(0, 2, &[0u32; 2]);
    let outcome = pipeline.launch(&scene, [2, 1, 1])?;
    assert_eq!(outcome.read_buffer::<u32>(0, 2)?, [7, 8]);
    assert_eq!(outcome.read_buffer::<u32>(0, 0)?, [7, 8]);
    assert_eq!(outcome.read_buffer::<u32>(0, 1)?, [7, 8, 4]);
    assert_eq!(outcome.read_buffer::<u32>(0, 3)?, [1, 7, 8, 4]);
    assert_eq!(scene.read_buffer::<u32>(0, 3)?, [1, 2, 3, 4]);
    let _ = pipeline.launch_mut(&mut scene, [1, 1, 1])?;
    assert_eq!(scene.read_buffer::<u32>(0, 1)?, [7, 3, 4]);
    assert_eq!(arena.bytes(), bytemuck::cast_slice::<u32, u8>(&[1, 2, 3, 4]));
    Ok(())
}

/// Whether two descriptors are of the same memory.
fn is_shared(one: &Descriptor, other: &Descriptor) -> bool {
    match (one, other) {
        (Descriptor::Buffer(one), Descriptor::Buffer(other)) => Arc::ptr_eq(one, other),
        (
            Descriptor::Image(one) | Descriptor::ImageSampler(one, _),
            Descriptor::Image(other) | Descriptor::ImageSampler(other, _),
        ) => Arc::ptr_eq(one, other),
        _ => false,
    }
}

/// What shaders read, or do not use, is not copied.
#[test]
fn memory_that_no_shader_writes_is_shared() -> Result<()> {
    let given = [
        Descriptor::Buffer(Buffer::zeroed(16)),
        Descriptor::Buffer(Buffer::zeroed(16)),
        Descriptor::Image(Image::plane(COUNT, 2, 1)?),
        Descriptor::Image(Image::plane(COUNT, 2, 1)?),
        Descriptor::Buffer(Buffer::zeroed(1 << 20)),
        Descriptor::ImageSampler(Image::plane(Format::RGBA32F, 2, 1)?, Arc::new(Sampler::default())),
    ];
    let variables = "
        @group(0) @binding(0) var<storage, read> numbers: array<u32>;
        @group(0) @binding(1) var<storage, read_write> sums: array<u32>;
        @group(0) @binding(2) var seen: texture_storage_2d<r32uint, read>;
        @group(0) @binding(3) var picture: texture_storage_2d<r32uint, write>;";
    let body = |at: &str| {
        format!(
            "sums[{at}] = numbers[{at}] + 5u;
             textureStore(picture, vec2u({at}, 0u), textureLoad(seen, vec2u({at}, 0u)) + 6u);"
        )
    };
    // Binding 1 and 3 are written, by a launch, a shader by itself, and a compute shader.
    let pipeline = ray_generation(variables, &body("id.x"))?;
    let mut scene = Scene::new([])?;
    let mut shader = ShaderTest::of(pipeline.programs[0].clone())?.launch([0, 0, 0], [2, 1, 1]);
    let mut compute = compute(variables, &body("at"))?;
    for (binding, descriptor) in (0..).zip(&given) {
        scene = scene.descriptor(0, binding, descriptor.clone());
        shader = shader.descriptor(0, binding, descriptor.clone());
        compute = compute.descriptor(0, binding, descriptor.clone());
    }
    let launched = pipeline.launch(&scene, [2, 1, 1])?;
    let (ran, dispatched) = (shader.run()?, compute.run()?);
    for (binding, descriptor) in (0..).zip(&given) {
        let left = [
            launched.descriptor(0, binding)?,
            ran.descriptor(0, binding)?,
            dispatched.descriptor(0, binding)?,
        ];
        let is_written = [1, 3].contains(&binding);
        assert_eq!(left.map(|left| is_shared(&left, descriptor)), [!is_written; 3], "binding {binding}");
    }
    assert_eq!(launched.read_buffer::<u32>(0, 1)?, [5, 5, 0, 0]);
    assert_eq!(ran.read_buffer::<u32>(0, 1)?, [5, 0, 0, 0]);
    assert_eq!(dispatched.image(0, 3)?.image().bytes(), [6, 0, 0, 0, 6, 0, 0, 0]);
    let error = launched.descriptor(1, 0).expect_err("nothing is bound there");
    assert_eq!(
        (error.kind(), error.message()),
        (ErrorKind::InvalidArgument, "nothing is bound at set 1, binding 0")
    );
    Ok(())
}

/// Counts its calls in the buffer at binding 0, and returns the count as payload.
fn counter() -> Result<Pipeline> {
    let source = "
        enable wgpu_ray_tracing_pipeline;
        @group(0) @binding(0) var<storage, read_write> count: array<u32, 1>;
        var<incoming_ray_payload> payload: u32;
        @closest_hit @incoming_payload(payload) fn hit() { count[0] += 1u; payload = count[0]; }";
    let module = Module::from_source("counter.wgsl", source)?;
    Pipeline::builder().hit([Program::of(&module, "hit")?])?.build()
}

#[test]
fn a_ray_leaves_the_scene_unless_it_is_told_to_write() -> Result<()> {
    let pipeline = counter()?;
    let mut scene = Scene::new([Instance::triangle(TRIANGLE).opaque()])?.buffer(0, 0, &[0u32]);
    for _ in 0..2 {
        let traced = pipeline.trace(&scene, down())?;
        assert_eq!((traced.payload.u32(), traced.read_buffer::<u32>(0, 0)?), (1, vec![1]));
    }
    assert_eq!(pipeline.trace_mut(&mut scene, down())?.payload.u32(), 1);
    let second = pipeline.trace_mut(&mut scene, down())?;
    assert_eq!((second.payload.u32(), scene.read_buffer::<u32>(0, 0)?), (2, vec![2]));
    // The explanation is of the ray as it was, whatever was traced since.
    let text = second.explain();
    let _ = pipeline.trace_mut(&mut scene, down())?;
    assert!(text.contains("payload after the ray  uint 2"), "{text}");
    assert_eq!(second.explain(), text);
    Ok(())
}

/// A shader record that has a device address may be written like a buffer that has one.
#[cfg(feature = "glsl")]
#[test]
fn a_launch_leaves_the_records_of_its_pipeline() -> Result<()> {
    const SOURCE: &str = "
        #version 460
        #extension GL_EXT_ray_tracing : require
        #extension GL_NV_shader_invocation_reorder : require
        #extension GL_EXT_buffer_reference : require
        #extension GL_EXT_buffer_reference_uvec2 : require
        layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
        layout(set = 0, binding = 1, std430) buffer Found { uint found; };
        layout(location = 0) rayPayloadEXT vec4 payload;
        layout(buffer_reference, std430) buffer Record { uint count; };
        void main() {
            hitObjectNV object;
            hitObjectTraceRayNV(object, scene, 0u, 0xFFu, 0u, 0u, 0u, vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0, 0.0, -1.0), 9.0, 0);
            Record record = Record(hitObjectGetShaderRecordBufferHandleNV(object));
            record.count += 1u;
            found = record.count;
        }";
    let module = Module::from_source("records.rgen", SOURCE.trim_start())?;
    let mut builder = Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.hit([])?;
    let group = builder.sbt().hit[0].as_ref().expect("the record of the hit group").group;
    builder.sbt().hit[0] = Some(SbtRecord::with_data(group, &5u32.to_le_bytes()));
    let pipeline = builder.build()?;
    let triangle = Instance::triangle(TRIANGLE).opaque();
    let scene = Scene::new([triangle.clone()])?.bind(0, 0).buffer(0, 1, &[0u32]);
    for _ in 0..2 {
        assert_eq!(pipeline.launch(&scene, [1, 1, 1])?.read_buffer::<u32>(0, 1)?, [6]);
    }
    let test = ShaderTest::new(&module, "main")?.buffer(0, 1, &[0u32]).hit_object_record(&8u32);
    let test = test.on_trace(move |trace| {
        trace.hit(triangle.clone());
        Ok(())
    });
    for _ in 0..2 {
        assert_eq!(test.run()?.read_buffer::<u32>(0, 1)?, [9]);
    }
    Ok(())
}

/// A picture in bands, whose invocations count themselves.
#[test]
fn a_launch_in_bands_leaves_the_scene() -> Result<()> {
    let pipeline = ray_generation(
        "@group(0) @binding(0) var picture: texture_storage_2d<r32uint, write>;
         @group(0) @binding(1) var<storage, read_write> count: atomic<u32>;",
        "textureStore(picture, id.xy, vec4u(id.x)); atomicAdd(&count, 1u);",
    )?;
    let scene = Scene::new([])?.buffer(0, 1, &[0u32]);
    for _ in 0..2 {
        let launched = pipeline.launch_bands(&scene, [8, 4], &StreamedImage::new(0, 0, COUNT), |_| Ok(()))?;
        assert_eq!(launched.read_buffer::<u32>(0, 1)?, [32]);
    }
    assert_eq!(scene.read_buffer::<u32>(0, 1)?, [0]);
    Ok(())
}

/// A launch fills an image, a compute shader doubles it, and the launch reads the result.
#[test]
fn outcomes_are_bound_to_further_runs() -> Result<()> {
    let pipeline = ray_generation(
        "@group(0) @binding(0) var before: texture_storage_2d<r32uint, read>;
         @group(0) @binding(1) var after: texture_storage_2d<r32uint, write>;",
        "textureStore(after, id.xy, textureLoad(before, id.xy) + 1u + id.x);",
    )?;
    let double = compute(
        "@group(0) @binding(0) var image: texture_storage_2d<r32uint, read_write>;",
        "let place = vec2u(at, 0u); textureStore(image, place, 2u * textureLoad(image, place));",
    )?;
    let image = || Image::zeroed(COUNT, ImageShape::plane(2, 1));
    let scene = Scene::new([])?.image(0, 0, image()?).image(0, 1, image()?);
    let first = pipeline.launch(&scene, [2, 1, 1])?;
    let doubled = double.descriptor(0, 0, first.descriptor(0, 1)?).run()?;
    let scene = scene.descriptor(0, 0, doubled.descriptor(0, 0)?);
    let second = pipeline.launch(&scene, [2, 1, 1])?;
    // 0 + 1 and 0 + 2; twice that; 2 + 1 and 4 + 2.
    assert_eq!(first.image(0, 1)?.image().bytes(), [1, 0, 0, 0, 2, 0, 0, 0]);
    assert_eq!(doubled.image(0, 0)?.image().bytes(), [2, 0, 0, 0, 4, 0, 0, 0]);
    assert_eq!(second.image(0, 1)?.image().bytes(), [3, 0, 0, 0, 6, 0, 0, 0]);
    Ok(())
}

/// Buffers that are bound and those that lie at an address alone.
#[test]
fn resources_of_a_scene_are_bound_to_further_runs() -> Result<()> {
    for (scene, name) in [("ray-query/compute", "outputs"), ("addresses/nested", "materials")] {
        let outcome = LoadedScene::open(format!("shaders/pass/{scene}/scene.toml"))?.launch()?;
        let Descriptor::Buffer(buffer) = outcome.descriptor(name)? else { panic!("{name} is no buffer") };
        assert_eq!(buffer.bytes(), outcome.read_buffer::<u8>(name)?);
        let error = outcome.descriptor("no-such").unwrap_err();
        assert!(error.message().contains("no resource `no-such`"), "{}", error.render());
    }
    Ok(())
}

#[test]
fn a_compute_test_is_run_again_and_again() -> Result<()> {
    let variables = "@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;";
    let mut test = compute(variables, "numbers[at] += 1u + at;")?.buffer(0, 0, &[0u32; 2]);
    let clone = test.clone();
    for test in [&test, &test, &clone] {
        assert_eq!(test.run()?.read_buffer::<u32>(0, 0)?, [1, 2]);
        let _ = test.sanitize()?;
    }
    let first = test.run_mut()?;
    assert_eq!(test.run_mut()?.read_buffer::<u32>(0, 0)?, [2, 4]);
    assert_eq!(test.run()?.read_buffer::<u32>(0, 0)?, [3, 6]);
    assert_eq!(first.read_buffer::<u32>(0, 0)?, [1, 2]);
    assert_eq!(clone.run()?.read_buffer::<u32>(0, 0)?, [1, 2]);
    Ok(())
}

/// What a debugger sets is gone with it, also in memory that the shader only reads.
#[test]
fn a_debugger_leaves_the_test() -> Result<()> {
    let variables = "
        @group(0) @binding(0) var<storage, read> given: array<u32, 2>;
        @group(0) @binding(1) var<storage, read_write> sums: array<u32, 2>;";
    let test = compute(variables, "sums[at] = given[at] + 1u;")?;
    let test = test.buffer(0, 0, &[1u32, 2]).buffer(0, 1, &[0u32; 2]);
    let transcript = test.debug([0, 0, 0], "set given[0] = 9\nprint given[0]")?;
    assert!(transcript.ends_with("9\n"), "{transcript}");
    let outcome = test.run()?;
    assert_eq!(
        (outcome.read_buffer::<u32>(0, 0)?, outcome.read_buffer::<u32>(0, 1)?),
        (vec![1, 2], vec![2, 3])
    );
    Ok(())
}
