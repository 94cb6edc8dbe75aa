//! What a user of the Rust interface must not get: a wrong value without an error, output of any
//! size, or a run without an end. Numbers follow from the shaders of
//! `shaders/pass/harness/conversions` and the sources below, by hand.

use std::fmt::Debug;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhit::{
    Case, Component, ComputeTest, Descriptor, Dimension, ErrorKind, Format, GeometryFlags, Hit, Image,
    ImageShape, Instance, InstanceFlags, LaunchLimits, LoadedScene, Module, Motion, Pipeline, Program, Ray,
    RayFlags, RayOperands, Result, Sampler, Scene, SeededRuns, ShaderTest, StreamedImage, StructData,
    WarningReports,
};

const CONVERSIONS: &str = "spirv-fixtures/pass/harness/conversions";

fn conversions(name: &str) -> Arc<Module> {
    Module::open(format!("{CONVERSIONS}/{name}")).expect("a fixture")
}

/// Stores 16777217 plus what it leaves in the buffer, which grows by 1, into an `r32ui` image.
fn accumulate() -> ShaderTest {
    ShaderTest::new(&conversions("accumulate.rgen.spv"), "main").expect("a shader").buffer(0, 0, &[1u32])
}

fn accumulating() -> Pipeline {
    let program = Program::of(&conversions("accumulate.rgen.spv"), "main").expect("a shader");
    let builder = Pipeline::builder().ray_generation(program).expect("a ray generation shader");
    builder.build().expect("a pipeline")
}

fn triangle() -> Hit {
    Hit::triangle([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
        .ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]))
}

/// Traces where its second push constant is above a half.
fn payload(trace: f32) -> ShaderTest {
    #[repr(C)]
    #[derive(Clone, Copy, Debug, bytemuck::NoUninit)]
    struct Constants {
        count: u32,
        scale: f32,
    }
    #[repr(C)]
    #[derive(Clone, Copy, Debug, bytemuck::NoUninit)]
    struct Record {
        id: u32,
        k: f32,
    }
    ShaderTest::new(&conversions("payload.rchit.spv"), "main")
        .expect("a shader")
        .hit(triangle())
        .buffer(0, 1, &[0u32; 8])
        .shader_record(&Record { id: 2, k: 0.0 })
        .push_constants(&Constants { count: 5, scale: trace })
}

fn plane(component: Component, channels: u8) -> Arc<Image> {
    Image::plane(Format::new(component, channels), 1, 1).expect("an image")
}

/// That something is a wrong argument, in these words.
#[track_caller]
fn invalid<T: Debug>(result: Result<T>, words: &[&str]) {
    let error = result.expect_err("it makes no sense");
    assert_eq!(error.kind(), ErrorKind::InvalidArgument, "{error:?}");
    let text = error.render();
    words.iter().for_each(|words| assert!(text.contains(words), "no `{words}` in: {text}"));
}

#[test]
fn an_image_has_the_declared_format() {
    let wrong = plane(Component::Uint8, 1);
    let words = [
        "set 0, binding 1",
        "the format r8ui",
        "declares the format r32ui",
        "`picture`",
        "Format::new(Component::Uint32, 1)",
    ];
    invalid(accumulate().image(0, 1, wrong.clone()).run(), &words);
    // Another width, count of channels, or sign.
    for (component, channels) in [(Component::Uint16, 1), (Component::Uint32, 2), (Component::Sint32, 1)] {
        invalid(accumulate().image(0, 1, plane(component, channels)).run(), &["declares the format r32ui"]);
    }
    let test = accumulate().image_sampler(0, 1, wrong.clone(), Sampler::default());
    invalid(test.run(), &words);
    invalid(accumulate().descriptor(0, 1, Descriptor::Image(wrong.clone())).sanitize(), &words);

    let scene = |image| Scene::new([]).expect("a scene").buffer(0, 0, &[0u32]).image(0, 1, image);
    invalid(accumulating().launch(&scene(wrong), [1, 1, 1]), &words);
    assert!(accumulating().launch(&scene(plane(Component::Uint32, 1)), [1, 1, 1]).is_ok());
    let bands = StreamedImage::new(0, 1, Format::new(Component::Uint8, 1));
    invalid(
        accumulating().launch_bands(&scene(plane(Component::Uint32, 1)), [1, 1], &bands, |_| Ok(())),
        &words,
    );
}

#[cfg(feature = "wgsl")]
const SAMPLED: &str = "
@group(0) @binding(0) var<storage, read_write> sums: array<f32>;
@group(1) @binding(2) var floats: texture_2d<f32>;
@group(1) @binding(3) var counts: texture_2d<u32>;
@group(1) @binding(4) var drawn: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(1)
fn main() {
    sums[0] = textureLoad(floats, vec2(0, 0), 0).x + f32(textureLoad(counts, vec2(0, 0), 0).x);
    textureStore(drawn, vec2(0, 0), vec4(1.0));
}";

#[cfg(feature = "wgsl")]
#[test]
fn an_image_without_a_declared_format_has_numbers_of_the_declared_class() {
    let module = Module::from_source("sampled.wgsl", SAMPLED).expect("a module");
    let test = |floats, counts, drawn| {
        ComputeTest::new(&module, "main")
            .expect("a shader")
            .buffer(0, 0, &[0.0f32])
            .image(1, 2, floats)
            .image(1, 3, counts)
            .image(1, 4, drawn)
    };
    let (unorm, uint) = (plane(Component::Unorm8, 4), plane(Component::Uint16, 2));
    let half = plane(Component::Float16, 4);
    assert!(test(unorm.clone(), uint.clone(), half.clone()).run().is_ok());
    assert!(test(plane(Component::SharedExponent, 3), uint.clone(), half.clone()).run().is_ok());
    let integers = ["set 1, binding 2", "unsigned integers (rg16ui)", "declares floats (`floats`)"];
    invalid(test(uint.clone(), uint.clone(), half.clone()).run(), &integers);
    let signed = ["binding 3", "signed integers (r32i)", "declares unsigned integers", "`counts`"];
    invalid(test(unorm.clone(), plane(Component::Sint32, 1), half.clone()).run(), &signed);
    invalid(test(unorm.clone(), half, plane(Component::Float16, 4)).run(), &["floats (rgba16f)"]);
    invalid(test(unorm.clone(), uint, unorm).run(), &["the format rgba8", "declares the format rgba16f"]);
}

#[test]
fn integer_texels_are_exact() {
    let outcome = accumulate().image(0, 1, plane(Component::Uint32, 1)).run().unwrap();
    let texels = outcome.image(0, 1).unwrap();
    // 16777217 + (1 + 1), which no f32 holds.
    assert_eq!(texels.at(0, 0)[0] as u32, 16777219);
    assert_eq!(texels.at_u32(0, 0), [16_777_219, 0, 0, 1]);
    assert_eq!(texels.rows(), [[[16_777_219.0, 0.0, 0.0, 1.0]]]);
    assert!(format!("{texels:?}").contains("[16777219, 0, 0, 1]"), "{texels:?}");
}

#[test]
fn texels_of_every_integer_width_are_exact() {
    let texels = |component, bytes: &[u8]| {
        let image = Image::new(Format::new(component, 1), ImageShape::plane(1, 1), bytes).unwrap();
        Scene::new([]).unwrap().image(0, 0, image).read_image(0, 0).unwrap()
    };
    // 2^53 + 1 is the first integer that an f64 does not hold.
    let odd = (1u64 << 53) + 1;
    assert_eq!(texels(Component::Uint64, &odd.to_le_bytes()).at_u64(0, 0), [odd, 0, 0, 1]);
    assert_eq!(texels(Component::Uint64, &u64::MAX.to_le_bytes()).at_u64(0, 0)[0], u64::MAX);
    let negative = -(odd.cast_signed());
    let wide = texels(Component::Sint64, &negative.to_le_bytes());
    assert_eq!(wide.at_i64(0, 0), [negative, 0, 0, 1]);
    assert!(format!("{wide:?}").contains("-9007199254740993"), "{wide:?}");
    assert_eq!(texels(Component::Sint32, &i32::MIN.to_le_bytes()).at_i32(0, 0), [i32::MIN, 0, 0, 1]);
    assert_eq!(texels(Component::Sint8, &[0x80]).at_i32(0, 0)[0], -128);
    assert_eq!(texels(Component::Uint16, &[0xFF, 0xFF]).at_u32(0, 0)[0], 65_535);
    assert_eq!(texels(Component::Float32, &0.1f32.to_le_bytes()).at_f32(0, 0)[0], 0.1);
}

#[test]
fn a_getter_of_another_kind_names_the_format_and_the_right_one() {
    let texels = |component| {
        let scene = Scene::new([]).unwrap().image(0, 0, plane(component, 1));
        scene.read_image(0, 0).unwrap()
    };
    let message = |read: &dyn Fn()| {
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(read)).expect_err("a panic");
        panic.downcast_ref::<String>().cloned().expect("a message")
    };
    let unsigned = message(&|| {
        let _ = texels(Component::Uint32).at_i32(0, 0);
    });
    assert!(unsigned.contains("r32ui") && unsigned.contains("`at_u32`"), "{unsigned}");
    let wide = message(&|| {
        let _ = texels(Component::Uint64).at_u32(0, 0);
    });
    assert!(wide.contains("r64ui") && wide.contains("`at_u64`"), "{wide}");
    let floats = message(&|| {
        let _ = texels(Component::Unorm8).at_u64(0, 0);
    });
    assert!(floats.contains("r8") && floats.contains("`at_f32`"), "{floats}");
    let outside = message(&|| {
        let _ = texels(Component::Unorm8).at(1, 0);
    });
    assert!(outside.contains("no texel (1, 0) in an image of 1 x 1"), "{outside}");
}

#[test]
fn formats_that_no_image_has_are_refused() {
    let srgb = |component, channels| Format { srgb: true, ..Format::new(component, channels) };
    let refused = [
        (Format::new(Component::Float32, 0), "N is 1, 2 or 4"),
        (Format::new(Component::Float32, 3), "N is 1, 2 or 4"),
        (Format::new(Component::Float32, 7), "no format has 7 channels of `Component::Float32`"),
        (Format::new(Component::Uint64, 4), "N is 1"),
        (Format::new(Component::Unorm10A2, 3), "N is 4"),
        (Format::new(Component::Float11B10, 4), "N is 3"),
        (Format::new(Component::Uint8, 255), "N is 1, 2 or 4"),
        (srgb(Component::Float32, 4), "no format stores `Component::Float32` sRGB-encoded"),
        (srgb(Component::Uint8, 1), "Format::RGBA8_SRGB"),
    ];
    let shape = ImageShape::plane(1, 1);
    for (format, words) in refused {
        invalid(Image::plane(format, 1, 1), &[words]);
        invalid(Image::zeroed(format, shape), &[words]);
        invalid(Image::null(format, shape), &[words]);
        for bytes in [0, 1, 4, 28] {
            invalid(Image::new(format, shape, &vec![0; bytes]), &[words]);
            invalid(Image::filled(format, shape, &vec![0; bytes]), &[words]);
        }
        let scene = Scene::new([]).unwrap().buffer(0, 0, &[0u32]);
        let streamed = StreamedImage::new(0, 1, format);
        invalid(accumulating().launch_bands(&scene, [1, 1], &streamed, |_| Ok(())), &[words]);
    }
    for format in [srgb(Component::Unorm8, 4), srgb(Component::Unorm8, 1), Format::RGBA8_SRGB] {
        assert!(Image::plane(format, 2, 2).is_ok());
    }
}

#[test]
fn shapes_that_no_image_has_are_refused_at_once() {
    let levels = ImageShape { levels: u32::MAX, ..ImageShape::plane(4, 4) };
    let cube = ImageShape { dimension: Dimension::Cube, ..ImageShape::plane(4, 4) };
    for shape in [levels, cube] {
        for result in [Image::zeroed(Format::RGBA32F, shape), Image::new(Format::RGBA32F, shape, &[])] {
            assert_eq!(result.unwrap_err().kind(), ErrorKind::InvalidImage);
        }
    }
}

#[test]
fn a_launch_id_lies_within_the_size() {
    invalid(
        payload(0.0).launch([5, 0, 0], [1, 1, 1]).run(),
        &["the launch id (5, 0, 0) is outside 1 x 1 x 1"],
    );
    invalid(payload(0.0).launch([0, 0, 0], [4, 4, 0]).run(), &["outside 4 x 4 x 0"]);
    assert!(payload(0.0).launch([3, 3, 0], [4, 4, 1]).run().is_ok());
}

#[test]
fn ray_flags_have_the_bits_of_the_specification() {
    let unknown = RayFlags(1 << 20);
    let words = ["0x100000", "bit 20", "bits 0 to 10"];
    invalid(payload(0.0).hit(triangle().ray_flags(unknown)).run(), &words);
    let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)]).unwrap();
    let pipeline = Pipeline::builder().build().unwrap();
    let ray = RayOperands::from(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    invalid(pipeline.trace(&scene, ray.clone().flags(unknown)), &words);
    // All bits but those that exclude each other.
    let known = RayFlags(1 | 4 | 8 | 16 | 512 | 1024);
    assert!(pipeline.trace(&scene, ray.flags(known)).is_ok());
    assert!(payload(0.0).hit(triangle().ray_flags(RayFlags::FORCE_OPACITY_MICROMAP_2_STATE)).run().is_ok());
}

/// `VkGeometryInstanceFlagBitsKHR` has bits 0 to 5, `VkGeometryFlagBitsKHR` 0 and 1.
#[test]
fn flags_of_instances_have_the_bits_of_the_specification() {
    let sphere = || Instance::sphere([0.0; 3], 0.5);
    for (instance, words) in [
        (sphere().flags(InstanceFlags(1 << 6)), "the instance flags 0x40 contain bit 6"),
        (sphere().geometry_flags(GeometryFlags(1 << 31)), "the geometry flags 0x80000000 contain bit 31"),
    ] {
        let text = Scene::new([instance]).unwrap_err().render();
        assert!(text.contains(words) && text.contains("combine the constants of `"), "{text}");
    }
    assert!(Scene::new([sphere().flags(InstanceFlags(0x33)).geometry_flags(GeometryFlags(3))]).is_ok());
}

#[test]
fn every_listed_answer_is_taken() {
    // Traces once, with a payload of 92 bytes.
    let module = Module::open("spirv-fixtures/pass/payload/structs/main.rchit.spv").unwrap();
    let hit = Hit::triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        .ray(Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]));
    let bouncing = ShaderTest::new(&module, "main").unwrap().hit(hit);
    let answers = |count| bouncing.clone().trace_answers(&vec![[0u32; 23]; count]);
    invalid(answers(3).run(), &["3 answers, 1 trace", "list as many answers"]);
    assert_eq!(answers(1).run().unwrap().traces.len(), 1);

    // A shader that makes no trace at all.
    let words = ["1 answer, 0 traces", "list as many answers"];
    invalid(payload(0.0).trace_answers(&[0u32]).run(), &words);
    invalid(payload(0.0).trace_answers(&[0u32]).sanitize(), &words);
    invalid(payload(0.0).execute_answers(&[0u32; 3]).run(), &["3 answers, 0 executions"]);
    invalid(payload(0.0).call_answers(&[0u32; 2]).run(), &["2 answers, 0 calls"]);
}

#[test]
fn a_builtin_that_is_set_is_read() {
    let error = payload(0.0).builtin("PrimitiveId", 3u32).run();
    invalid(error, &["does not read PrimitiveId", "it reads RayTmaxKHR"]);
    assert!(payload(0.0).builtin("RayTmaxKHR", 3.0f32).run().is_ok());
}

#[test]
fn warnings_of_a_run_are_a_list() {
    let test = accumulate().image(0, 1, plane(Component::Uint32, 1));
    let warnings: WarningReports = test.sanitize().unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!((warnings.len(), warnings.iter().count()), (0, 0));
    assert_eq!(serde_json::to_value(&warnings).unwrap(), serde_json::json!([]));
    assert_eq!((warnings.as_slice().len(), warnings.into_vec().len()), (0, 0));
}

#[test]
fn no_seed_is_no_passed_check() {
    let scene = LoadedScene::open("shaders/pass/ray-query/compute/scene.toml").unwrap();
    invalid(scene.many_seeds(0), &["the range of seeds", "many_seeds(8)"]);
    assert!(scene.many_seeds(1).unwrap().is_empty());
}

/// A finding in workgroup memory names its shader, which no file of a scene has.
#[test]
fn a_compute_test_finds_unwritten_workgroup_memory() {
    let run = |name: &str| {
        let module =
            Module::open(format!("spirv-fixtures/many-seeds/workgroup-drawn/{name}.comp.spv")).unwrap();
        let pixels: Vec<f32> = [1.0; 8].into_iter().chain([0.5; 3]).collect();
        let test =
            ComputeTest::new(&module, "main").unwrap().buffer(0, 1, &pixels[..]).buffer(0, 2, &[0.0f32; 2]);
        test.workgroups([2, 1, 1]).many_seeds(8)
    };
    let error = run("broken").unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Finding);
    assert!(error.render().contains("workgroup memory holds something else at the beginning"), "{error}");
    assert!(run("mended").unwrap().is_empty());
}

#[test]
fn a_motion_stands_alone() {
    let at = |x: f32| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let motion = Motion::Matrix([at(0.0), at(4.0)]);
    let sphere = || Instance::sphere([0.0; 3], 0.5);
    for both in [
        sphere().translate([0.0, 1.0, 0.0]).motion(motion.clone()),
        sphere().motion(motion.clone()).transform(at(2.0)),
    ] {
        let error = Scene::new([both]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidScene);
        let text = error.render();
        assert!(
            text.contains("motion also has a transform") && text.contains("leave out `.transform`"),
            "{text}"
        );
    }
    assert!(Scene::new([sphere().motion(motion)]).is_ok());
}

#[test]
fn a_folder_without_cases_is_no_passed_test() {
    let folder = std::path::Path::new(CONVERSIONS);
    invalid(Case::discover(folder), &["has no `scene.toml`", "conversions"]);
}

#[test]
fn nothing_prints_without_end() {
    const LARGE: usize = 1 << 18;
    #[track_caller]
    fn short(value: &dyn Debug) {
        let text = format!("{value:?}");
        assert!(text.len() < 100_000, "{} bytes: {} ...", text.len(), &text[..200]);
    }
    let image = Image::plane(Format::RGBA32F, 512, 512).unwrap();
    let vertices: Vec<[f32; 3]> = (0..3 * LARGE).map(|at| [at as f32, (at % 2) as f32, 0.0]).collect();
    let instance = Instance::triangles(vertices);
    let module = conversions("accumulate.rgen.spv");
    let scene = Scene::new([instance.clone()]).unwrap().buffer(0, 0, &vec![1u32; LARGE]);
    let scene = scene.image(0, 1, Image::plane(Format::new(Component::Uint32, 1), 512, 512).unwrap());
    let test = accumulate().buffer(0, 0, &vec![1u32; LARGE]);
    let test = test.image(0, 1, Image::plane(Format::new(Component::Uint32, 1), 512, 512).unwrap());
    short(&image);
    short(&instance);
    short(&Hit::of(instance));
    short(&scene);
    short(&module);
    short(&Program::of(&module, "main").unwrap());
    short(&accumulating());
    short(&test);
    short(&accumulating().launch(&scene, [4, 4, 1]).unwrap());
    let outcome = test.run().unwrap();
    short(&outcome);
    short(&outcome.image(0, 1).unwrap());
    short(&outcome.buffer(0, 0).unwrap());
    let types = conversions("types.comp.spv");
    short(&StructData::buffer(&types, 0, 0).unwrap());
    let mut buffers = anyhit::DeviceBuffers::new();
    buffers.add("large", &vec![0u32; LARGE]).unwrap();
    short(&buffers);
    let mut loaded = LoadedScene::open("shaders/pass/ray-query/compute/scene.toml").unwrap();
    short(&loaded.launch().unwrap());
    loaded.set_shader_record("none", &0u32).unwrap_err();
    loaded.set_buffer("outputs", &[0u32; 4]).unwrap();
    short(&loaded);

    // A summary says what it is and how large, and begins with the first values.
    assert_eq!(format!("{:?}", anyhit::Buffer::new(&[1, 2, 255])), "Buffer(3 bytes: 01 02 ff)");
    let buffer = format!("{:?}", anyhit::Buffer::zeroed(1 << 20));
    assert!(buffer.starts_with("Buffer(1048576 bytes: 00 00") && buffer.ends_with("...)"), "{buffer}");
    let image = format!("{image:?}");
    assert!(image.starts_with("Image(rgba32f, D2, 512 x 512 x 1"), "{image}");
}

#[test]
fn an_endless_loop_ends_in_time() {
    let module = Module::open("spirv-fixtures/fail/control-flow/endless-loop/main.rgen.spv").unwrap();
    let test = ShaderTest::new(&module, "main").unwrap().fuel(u64::MAX);
    let test = test.buffer(0, 1, &[0u32; 4]).launch([3, 0, 0], [4, 1, 1]);
    let limits = LaunchLimits::default().timeout(Duration::from_millis(50));
    let began = Instant::now();
    let error = test.clone().launch_limits(limits).run().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Trap, "{error:?}");
    assert!(error.render().contains("LaunchLimits::timeout"), "{}", error.render());
    let limits = LaunchLimits::default().fuel(1 << 20);
    let error = test.launch_limits(limits).run().unwrap_err();
    assert!(error.render().contains("LaunchLimits::fuel"), "{}", error.render());
    assert!(began.elapsed() < Duration::from_secs(10));
}

#[cfg(feature = "wgsl")]
#[test]
fn an_endless_dispatch_ends_in_time() {
    let source = "@group(0) @binding(0) var<storage, read_write> n: u32;
                  @compute @workgroup_size(1) fn main() { loop { n += 1u; if (n == 0u) { n = 1u; } } }";
    let module = Module::from_source("endless.wgsl", source).unwrap();
    let test = ComputeTest::new(&module, "main").unwrap().buffer(0, 0, &[0u32]).fuel(u64::MAX);
    let limits = LaunchLimits::default().timeout(Duration::from_millis(50));
    let error = test.launch_limits(limits).run().unwrap_err();
    assert!(error.render().contains("LaunchLimits::timeout"), "{}", error.render());
}

/// As `anyhit test`: 8 seconds for invocations that run together. A test waits for it once.
#[test]
fn an_endless_loop_ends_by_default() {
    let module = Module::open("spirv-fixtures/fail/control-flow/endless-loop/main.rgen.spv").unwrap();
    let test = ShaderTest::new(&module, "main").unwrap().fuel(u64::MAX);
    let test = test.buffer(0, 1, &[0u32; 4]).launch([3, 0, 0], [4, 1, 1]);
    let began = Instant::now();
    let error = test.run().unwrap_err();
    let seconds = began.elapsed().as_secs();
    assert!(error.render().contains("LaunchLimits::batch_timeout"), "{}", error.render());
    assert!((8..30).contains(&seconds), "{seconds} seconds");
}

#[test]
fn outcomes_are_equal_by_value() {
    let image = || plane(Component::Uint32, 1);
    let [one, same] = [accumulate().image(0, 1, image()), accumulate().image(0, 1, image())].map(|test| {
        let outcome = test.run().unwrap();
        assert_eq!(outcome, test.run().unwrap());
        outcome
    });
    assert_eq!(one, same);
    // Another buffer, and so another texel; another payload; a push constant that no output shows.
    assert_ne!(one, accumulate().image(0, 1, image()).buffer(0, 0, &[2u32]).run().unwrap());
    assert_ne!(payload(0.0).run().unwrap(), payload(0.0).payload_member("hits", 1u32).run().unwrap());

    let scene =
        |first: u32| Scene::new([]).unwrap().buffer(0, 0, &[first]).image(0, 1, plane(Component::Uint32, 1));
    let launched = |first| accumulating().launch(&scene(first), [1, 1, 1]).unwrap();
    assert_eq!(launched(0), launched(0));
    assert_ne!(launched(0), launched(1));
    let spheres = Scene::new([Instance::sphere([0.0; 3], 0.5)]).unwrap();
    let pipeline = Pipeline::builder().build().unwrap();
    let traced = |z: f32| pipeline.trace(&spheres, Ray::new([0.0, 0.0, z], [0.0, 0.0, -1.0])).unwrap();
    assert_eq!(traced(4.0), traced(4.0));
    assert_ne!(traced(4.0), traced(5.0));
    let loaded = LoadedScene::open("shaders/pass/ray-query/compute/scene.toml").unwrap();
    assert_eq!(loaded.launch().unwrap(), loaded.launch().unwrap());
}

#[test]
fn results_are_written_as_json() {
    // hits: 0 + 5 + 2; the ray at (0, 0) hits the middle of the triangle at t = 4: barycentrics of
    // the second and third vertex are 1/4 and 1/2.
    let outcome = payload(0.0).run().unwrap();
    let json = serde_json::to_value(&outcome).unwrap();
    assert_eq!(json["exit"], "returned");
    assert_eq!(json["payload"]["hits"], 7);
    assert_eq!(json["payload"]["flag"], false);
    assert_eq!(json["payload"]["i"], -1);
    assert_eq!(json["payload"]["c"], serde_json::json!([0.25, 0.5, 4.0]));
    let nan = payload(0.0).payload_member("d", f64::NAN).run().unwrap();
    assert_eq!(serde_json::to_value(&nan).unwrap()["payload"]["d"], "NaN");

    let spheres = Scene::new([Instance::sphere([0.0; 3], 0.5)]).unwrap();
    let pipeline = Pipeline::builder().build().unwrap();
    let traced = |x: f32| pipeline.trace(&spheres, Ray::new([x, 0.0, 4.0], [0.0, 0.0, -1.0])).unwrap();
    let hit = serde_json::to_value(traced(0.0)).unwrap();
    assert_eq!((&hit["hit"]["t"], &hit["stats"]["rays"]), (&3.5.into(), &1.into()));
    assert!(serde_json::to_value(traced(9.0)).unwrap()["hit"].is_null());
}

/// The scene of `shaders/pass/compute/structured-heap`, whose comments derive the values.
#[test]
fn heaps_and_their_data_are_bound_by_index() {
    let module = Module::open("spirv-fixtures/pass/compute/structured-heap/main.comp.spv").unwrap();
    let mut data = vec![0_u32; 116];
    (data[64], data[97], data[113]) = (2, 3_f32.to_bits(), 5_f32.to_bits());
    let picture = Image::plane(Format::new(Component::Uint32, 1), 4, 1).unwrap();
    let test = ComputeTest::new(&module, "main")
        .unwrap()
        .push_constants(&[1024_u32, 1])
        .heap_data(&data)
        .heap_buffer(9, &[0_u32; 4])
        .heap_buffer(13, &[10_u32, 20, 30, 40])
        .heap_buffer(15, &[1_u32, 2, 3, 4])
        .heap_buffer(32, &[0_u32; 4])
        .heap(33, Descriptor::Image(picture));
    let outcome = test.run().unwrap();
    assert_eq!(outcome.read_heap_buffer::<u32>(32).unwrap(), [30, 10, 90, 20]);
    assert_eq!(outcome.read_heap_buffer::<u32>(9).unwrap(), [1, 2, 1, 2]);
    // What was given is not what was written.
    assert_eq!(test.run().unwrap().read_heap_buffer::<u32>(32).unwrap(), [30, 10, 90, 20]);
    let Descriptor::Image(written) = outcome.heap(33).unwrap() else { panic!("an image was given") };
    assert_eq!(written.bytes(), [7_u32, 8, 9, 10].map(u32::to_le_bytes).concat());
    assert!(outcome.heap(34).unwrap_err().render().contains("nothing is at index 34"));
    assert!(outcome.read_heap_buffer::<u32>(33).unwrap_err().render().contains("no buffer is at index 33"));
    let far = test.heap_buffer(1 << 20, &[0_u32]).run().unwrap_err();
    assert_eq!(far.kind(), ErrorKind::InvalidArgument, "{}", far.render());
    assert!(far.render().contains("at most 1048576 descriptors"), "{}", far.render());
}
