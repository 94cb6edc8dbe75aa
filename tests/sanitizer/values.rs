//! What the sanitizer reports of values: those that nothing reads, constants, NaNs and infinities
//! on their way, texels.

use std::sync::Arc;

use anyhit::{CompileOptions, Component, ComputeTest, Format, Pipeline, ShaderTest, Source};
use anyhit_engine::machine::image::{Dimension, Image, ImageShape};
use anyhit_engine::machine::sampler::Sampler;
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::module::{self, Module};
use anyhit_engine::pipeline::{Compute, Launch, RunOptions};
use anyhit_engine::program::lower;
use anyhit_sanitize::{Findings, Levels, ProgramPlan, Sanitizer};

use crate::support::assembly::assemble;

/// The module of a compute shader in GLSL, of which the version and the directives are left out.
fn module(text: &str) -> Module {
    compiled("main.comp", text)
}

/// The module of a shader in GLSL, of which the version and the directives are left out.
fn compiled(name: &str, text: &str) -> Module {
    let text = format!(
        "#version 460\n#extension GL_EXT_ray_tracing : enable\n#extension GL_KHR_shader_subgroup_arithmetic : enable\n\
         #extension GL_KHR_shader_subgroup_ballot : enable\n\
         #extension GL_KHR_shader_subgroup_shuffle : enable\n\
         #extension GL_EXT_shader_explicit_arithmetic_types : enable\n\
         #extension GL_EXT_shader_atomic_float : enable\n\
         #extension GL_EXT_debug_printf : enable\n{text}"
    );
    let source = Source::from_text(name, text).expect("a source");
    let spirv = source.compile(&CompileOptions::default());
    module::load(&spirv.unwrap_or_else(|error| panic!("{}", error.render()))).expect("a module")
}

/// A buffer of floats.
fn floats(values: &[f32]) -> Descriptor {
    Descriptor::Buffer(Buffer::new(&values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>()))
}

/// The rules that a dispatch of one workgroup breaks, each with what is reported; a trap is the
/// last.
fn found_in(module: Module, resources: &Resources) -> Vec<(&'static str, String)> {
    let module = Arc::new(module);
    let program =
        lower(&module, &module.entry_points[0]).unwrap_or_else(|error| panic!("{}", error.render()));
    let compute =
        Compute::new(program).and_then(|compute| compute.for_sanitizer()).expect("a compute shader");
    let (plans, levels) = ([ProgramPlan::new(&compute.program)], Levels::default());
    let mut sanitizer = Sanitizer::new(&plans, &levels).with_resources(resources);
    let outcome = compute.run_observed(resources, [1; 3], &mut |_| (), &mut sanitizer);
    let mut findings: Findings = sanitizer.into_findings();
    if let Err(trap) = outcome {
        findings.add_stop(&trap);
    }
    findings.iter().map(|finding| (finding.rule.id, finding.error.message().to_owned())).collect()
}

/// The rules that a dispatch breaks, of a shader with floats at binding 0.
fn rules(text: &str, resources: Resources, input: &[f32]) -> Vec<&'static str> {
    found_in(module(text), &resources.bind(0, 0, floats(input))).into_iter().map(|(rule, _)| rule).collect()
}

/// The rules of a shader that computes with the floats `x[0]` and `x[1]`, and writes to `y`.
fn rules_of(declarations: &str, body: &str, input: [f32; 2]) -> Vec<&'static str> {
    let text = format!(
        "layout(local_size_x = 4) in;
         layout(set = 0, binding = 0) readonly buffer X {{ float x[]; }};
         layout(set = 0, binding = 1) buffer Y {{ uint y[4]; }};
         {declarations}
         void main() {{ uint id = gl_LocalInvocationIndex; {body} }}"
    );
    rules(&text, Resources::default().bind(0, 1, floats(&[0.0; 4])), &input)
}

#[test]
fn loads_whose_values_nothing_reads_are_checked() {
    let outside = |body: &str| rules_of("shared float s[4];", body, [0.0, 1.0]);
    assert_eq!(outside("float a = x[1000u + id]; y[id] = 5u;"), ["buffer-bounds"]);
    assert_eq!(outside("float a = x[id & 1u]; y[id] = 5u;"), [""; 0]);
    // In a function whose result nothing reads.
    let called = |index: &str| {
        let function = format!("float element(uint i) {{ return x[{index}]; }}");
        rules_of(&function, "element(id); y[id] = 5u;", [0.0, 1.0])
    };
    assert_eq!(called("i + 7u"), ["buffer-bounds"]);
    assert_eq!(called("i & 1u"), [""; 0]);
    // Of a local array, by an index that is only known while it runs.
    let local = |index: &str| {
        let body = format!("float a[2]; a[0] = x[0]; a[1] = x[1]; float b = a[{index}]; y[id] = 5u;");
        rules_of("", &body, [0.0, 1.0])
    };
    assert_eq!(local("id"), ["local-array-bounds"]);
    assert_eq!(local("id & 1u"), [""; 0]);
    // A division whose quotient nothing reads, and one behind a branch that is not taken.
    assert_eq!(outside("uint a = 7u / uint(x[0]); y[id] = 5u;"), ["int-div-zero"]);
    assert_eq!(outside("if (x[0] != 0.0) { uint a = 7u / uint(x[0]); } y[id] = 5u;"), [""; 0]);
    assert_eq!(outside("const bool never = false; if (never) { float a = x[900]; } y[id] = 5u;"), [""; 0]);
    // A race by a load whose value nothing reads.
    let race = "s[id] = 1.0; float a = s[3u - id]; y[id] = 5u;";
    assert_eq!(outside(race).first().map(|rule| rule.starts_with("race-")), Some(true));
    assert_eq!(outside("s[id] = 1.0; barrier(); float a = s[3u - id]; y[id] = 5u;"), [""; 0]);
    // An undefined value that nothing depends on is no mistake: it is copied.
    assert_eq!(outside("float a = sqrt(x[0] - x[1]); y[id] = 5u;"), [""; 0]);
}

/// A shader whose specialization constant 0 divides, shifts or converts.
fn specialized(operation: &str, value: u64) -> Vec<(&'static str, String)> {
    let text = format!(
        "OpCapability Shader
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\" %buffer
         OpExecutionMode %main LocalSize 1 1 1
         OpName %result \"result\"
         OpDecorate %k SpecId 0
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         OpDecorate %buffer DescriptorSet 0
         OpDecorate %buffer Binding 0
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %bool = OpTypeBool
         %uint = OpTypeInt 32 0
         %int = OpTypeInt 32 1
         %pair = OpTypeVector %int 2
         %u0 = OpConstant %uint 0
         %u10 = OpConstant %uint 10
         %least = OpConstant %uint 2147483648
         %i1 = OpConstant %int 1
         %i10 = OpConstant %int 10
         %k = OpSpecConstant %uint 1
         %ki = OpSpecConstantOp %int IAdd %k %u0
         %is_zero = OpSpecConstantOp %bool IEqual %k %u0
         %tens = OpConstantComposite %pair %i10 %i10
         %ks = OpSpecConstantComposite %pair %i1 %ki
         {operation}
         %block = OpTypeStruct %int
         %ptr_block = OpTypePointer StorageBuffer %block
         %ptr_int = OpTypePointer StorageBuffer %int
         %buffer = OpVariable %ptr_block StorageBuffer
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         %at = OpAccessChain %ptr_int %buffer %u0
         OpStore %at %result
         OpReturn
         OpFunctionEnd"
    );
    let mut module = module::load(&assemble(&text)).expect("a module");
    module.specialize(0, value).expect("a specialization constant");
    found_in(module, &Resources::default().bind(0, 0, Descriptor::Buffer(Buffer::zeroed(4))))
}

#[test]
fn operations_of_specialization_constants_are_checked() {
    let rules = |operation: &str, value: u64| -> Vec<&'static str> {
        specialized(operation, value).into_iter().map(|(rule, _)| rule).collect()
    };
    let quotient = "%q = OpSpecConstantOp %uint UDiv %u10 %k\n%result = OpSpecConstantOp %int IAdd %q %u0";
    assert_eq!(
        specialized(quotient, 0),
        [("int-div-zero", "the division of 10 by zero, in a specialization constant".to_owned())]
    );
    assert_eq!(rules(quotient, 5), [""; 0]);
    let divided = "%result = OpSpecConstantOp %int SDiv %i10 %ki";
    assert_eq!(
        specialized(divided, 0),
        [("int-div-zero", "the division of 10 by zero, in the specialization constant `result`".to_owned())]
    );
    for opcode in ["%int SRem %i10 %ki", "%int SMod %i10 %ki", "%uint UMod %u10 %k"] {
        let operation = format!(
            "%remainder = OpSpecConstantOp {opcode}\n%result = OpSpecConstantOp %int IAdd %remainder %u0"
        );
        assert_eq!(rules(&operation, 0), ["int-div-zero"], "{opcode}");
        assert_eq!(rules(&operation, 3), [""; 0], "{opcode}");
    }
    let least = "%m = OpSpecConstantOp %int IAdd %least %u0\n%result = OpSpecConstantOp %int SDiv %m %ki";
    assert_eq!(rules(least, 0xFFFF_FFFF), ["int-div-overflow"]);
    assert_eq!(rules(least, 2), [""; 0]);
    let shift = "%result = OpSpecConstantOp %int ShiftLeftLogical %i10 %k";
    assert_eq!(rules(shift, 32), ["shift-range"]);
    assert_eq!(rules(shift, 31), [""; 0]);
    // Components of a composite, and an operand that a select does not choose: OpSelect takes the
    // result of an instruction that is executed all the same.
    let component = "%both = OpSpecConstantOp %pair SDiv %tens %ks\n\
                     %result = OpSpecConstantOp %int CompositeExtract %both 0";
    assert_eq!(rules(component, 0), ["int-div-zero"]);
    assert_eq!(rules(component, 2), [""; 0]);
    let chosen = "%q = OpSpecConstantOp %int SDiv %i10 %ki\n\
                  %result = OpSpecConstantOp %int Select %is_zero %i1 %q";
    assert_eq!(rules(chosen, 0), ["int-div-zero"]);
    // A constant that no instruction uses is not executed.
    let unused = "%q = OpSpecConstantOp %int SDiv %i10 %ki\n%result = OpSpecConstantOp %int IAdd %i10 %ki";
    assert_eq!(rules(unused, 0), [""; 0]);
}

#[test]
fn a_nan_is_followed_from_where_it_was_made() {
    /// A quotient of `x[0]` and `x[1]`, which does not exist for 0 and 0.
    const Q: &str = "float q = x[0] / x[1];";
    let shared = "shared float s[4]; shared uint u[4]; shared vec2 v[4];";
    let cases = [
        ("", "y[id] = floatBitsToUint(q);"),
        ("", "y[id] = packHalf2x16(vec2(q, 1.0));"),
        ("", "y[id] = packHalf2x16(vec2(1.0, q));"),
        ("", "y[id] = packUnorm4x8(vec4(q));"),
        ("", "y[id] = packSnorm2x16(vec2(q));"),
        ("", "y[id] = floatBitsToUint(unpackHalf2x16(packHalf2x16(vec2(1.0, q))).y);"),
        ("", "y[id] = floatBitsToUint(q) ^ 0x80000000u;"),
        ("", "y[id] = floatBitsToUint(q) >> 16;"),
        ("", "y[id] = floatBitsToUint(float(float16_t(q)));"),
        ("", "y[id] = uint(float16BitsToUint16(float16_t(q)));"),
        ("", "uvec2 d = unpackDouble2x32(double(q)); y[id] = d.y;"),
        ("", "y[id] = floatBitsToUint(id < 9u ? q : 1.0);"),
        ("", "float a[4]; a[id] = q; y[id] = floatBitsToUint(a[id]);"),
        ("", "float a = 1.0; for (uint i = 0; i < 2u; i++) { a = q; } y[id] = floatBitsToUint(a);"),
        ("struct S { uint n; float f; };", "S t = S(id, q); S k = t; y[id] = floatBitsToUint(k.f);"),
        (shared, "s[id] = q; barrier(); y[id] = floatBitsToUint(s[3u - id]);"),
        (shared, "u[id] = floatBitsToUint(q); barrier(); y[id] = u[3u - id];"),
        (shared, "v[id] = vec2(1.0, q); barrier(); y[id] = floatBitsToUint(v[3u - id].y);"),
        (shared, "atomicExchange(u[id], floatBitsToUint(q)); barrier(); y[id] = u[3u - id];"),
        (shared, "u[id] = floatBitsToUint(q); y[id] = atomicAdd(u[id], 0u);"),
        (shared, "s[id] = 0.0; atomicAdd(s[id], q); y[id] = floatBitsToUint(s[id]);"),
        ("", "y[id] = floatBitsToUint(subgroupBroadcastFirst(q));"),
        ("", "y[id] = floatBitsToUint(subgroupShuffle(q, 3u - id));"),
        ("", "y[id] = floatBitsToUint(subgroupAdd(q));"),
        ("", "y[id] = floatBitsToUint(subgroupInclusiveMul(q));"),
        ("", "y[id] = subgroupOr(floatBitsToUint(q));"),
        ("", "atomicOr(y[id], floatBitsToUint(q));"),
        ("", "debugPrintfEXT(\"%u\", floatBitsToUint(q));"),
    ];
    for (declarations, body) in cases {
        let body = format!("{Q} {body}");
        assert_eq!(rules_of(declarations, &body, [0.0, 0.0]), ["ulp-domain"], "{body}");
        assert_eq!(rules_of(declarations, &body, [3.0, 2.0]), [""; 0], "{body}");
    }
}

#[test]
fn what_is_left_of_no_nan_is_not_told() {
    let silent = [
        // The other half of a word, a number that was clamped, a test of the bits, another branch.
        "y[id] = floatBitsToUint(unpackHalf2x16(packHalf2x16(vec2(1.0, q))).x);",
        "y[id] = packHalf2x16(vec2(q, 1.0)) >> 16;",
        "y[id] = (floatBitsToUint(q) & 0x7fffffffu) > 0x7f800000u ? 1u : 0u;",
        "y[id] = floatBitsToUint(id > 9u ? q : 1.0);",
        "float a = q; a = 2.0; y[id] = floatBitsToUint(a);",
        "y[id] = 3u;",
    ];
    for body in silent {
        let body = format!("float q = x[0] / x[1]; {body}");
        assert_eq!(rules_of("", &body, [0.0, 0.0]), [""; 0], "{body}");
    }
    // A NaN that a buffer held was made by no instruction.
    assert_eq!(rules_of("", "y[id] = packHalf2x16(vec2(x[0]));", [f32::NAN, 0.0]), [""; 0]);
    // An infinity is followed, too; as a lint where a division by zero made it.
    let packed = "y[id] = packHalf2x16(vec2(x[0] / x[1]));";
    assert_eq!(rules_of("", packed, [1.0, 0.0]), ["fdiv-zero"]);
    assert_eq!(rules_of("", "y[id] = packUnorm4x8(vec4(x[0] / x[1]));", [1.0, 0.0]), [""; 0]);
    // The sum of two numbers of different lanes overflows.
    let sum = "y[id] = floatBitsToUint(subgroupAdd(x[0]));";
    assert_eq!(rules_of("", sum, [3e38, 0.0]), ["fastmath-default"]);
    // The identity of a minimum is infinite.
    assert_eq!(rules_of("", "y[id] = floatBitsToUint(subgroupExclusiveMin(x[0]));", [1.0, 0.0]), [""; 0]);
}

/// An image of a format, with 4 x 2 texels.
fn image(component: Component, channels: u8) -> Descriptor {
    let shape = ImageShape::plane(4, 2);
    Descriptor::Image(Image::zeroed(Format::new(component, channels), shape).expect("an image"))
}

/// The rules that a shader breaks with an image at binding 1, whose declaration is given.
fn rules_of_image(declaration: &str, body: &str, bound: Descriptor) -> Vec<&'static str> {
    let text = format!(
        "layout(local_size_x = 2) in;
         layout(set = 0, binding = 0) buffer Y {{ float y[]; }};
         layout(set = 0, binding = 1{declaration};
         void main() {{ int id = int(gl_LocalInvocationIndex); {body} }}"
    );
    rules(&text, Resources::default().bind(0, 1, bound), &[0.0; 4])
}

#[test]
fn the_format_of_a_view_is_the_declared_one() {
    let write = "imageStore(t, ivec2(id, 0), vec4(1));";
    let read = "y[id] = imageLoad(t, ivec2(id, 0)).x;";
    let copy = "vec4 a = imageLoad(t, ivec2(id, 0)); y[id] = 1.0;";
    let declared = ", r32f) uniform image2D t";
    for body in [write, read] {
        let of = |component, channels| rules_of_image(declared, body, image(component, channels));
        assert_eq!(of(Component::Float32, 1), [""; 0], "{body}");
        assert_eq!(of(Component::Unorm8, 4), ["image-format"], "{body}");
        assert_eq!(of(Component::Float32, 4), ["image-format"], "{body}");
        assert_eq!(of(Component::Float16, 1), ["image-format"], "{body}");
    }
    // What is read and not used is no mistake.
    assert_eq!(rules_of_image(declared, copy, image(Component::Unorm8, 4)), [""; 0]);
    // Integers of the other sign, with a format and without.
    let signed = "imageStore(t, ivec2(id, 0), ivec4(1));";
    assert_eq!(rules_of_image(", r32i) uniform iimage2D t", signed, image(Component::Sint32, 1)), [""; 0]);
    assert_eq!(
        rules_of_image(", r32i) uniform iimage2D t", signed, image(Component::Uint32, 1)),
        ["image-format"]
    );
    let unknown = ") uniform writeonly iimage2D t";
    assert_eq!(rules_of_image(unknown, signed, image(Component::Sint16, 2)), [""; 0]);
    assert_eq!(rules_of_image(unknown, signed, image(Component::Uint16, 2)), ["image-format"]);
    // Atomic instructions.
    let atomic = "imageAtomicAdd(t, ivec2(id, 0), 1u);";
    assert_eq!(rules_of_image(", r32ui) uniform uimage2D t", atomic, image(Component::Uint32, 1)), [""; 0]);
    assert_eq!(
        rules_of_image(", r32ui) uniform uimage2D t", atomic, image(Component::Sint32, 1)),
        ["image-format"]
    );
}

#[test]
fn sampled_images_and_texel_buffers_have_the_declared_type_of_numbers() {
    let sampled = |component| {
        let Descriptor::Image(image) = image(component, 4) else { panic!("an image") };
        Descriptor::ImageSampler(image, Arc::new(Sampler::default()))
    };
    let fetch = "y[id] = float(texelFetch(t, ivec2(id, 0), 0).x);";
    let sample = "y[id] = float(textureLod(t, vec2(0.5), 0.0).x);";
    for body in [fetch, sample] {
        let of = |component| rules_of_image(") uniform usampler2D t", body, sampled(component));
        assert_eq!(of(Component::Uint8), [""; 0], "{body}");
        assert_eq!(of(Component::Sint8), ["image-format"], "{body}");
    }
    let buffer = |component| {
        let shape = ImageShape { dimension: Dimension::Buffer, ..ImageShape::plane(4, 1) };
        Descriptor::Image(Image::zeroed(Format::new(component, 1), shape).expect("a texel buffer"))
    };
    let texel = "y[id] = float(texelFetch(t, id).x);";
    let of = |component| rules_of_image(") uniform isamplerBuffer t", texel, buffer(component));
    assert_eq!(of(Component::Sint32), [""; 0]);
    assert_eq!(of(Component::Uint32), ["image-format"]);
    let store = "imageStore(t, id, uvec4(1));";
    let of = |component| rules_of_image(", r32ui) uniform uimageBuffer t", store, buffer(component));
    assert_eq!(of(Component::Uint32), [""; 0]);
    assert_eq!(of(Component::Uint16), ["image-format"]);
}

#[test]
fn outside_an_image_a_write_has_no_effect_and_a_read_is_undefined() {
    let of = |body: &str| rules_of_image(", r32f) uniform image2D t", body, image(Component::Float32, 1));
    assert_eq!(of("imageStore(t, ivec2(id + 3, 0), vec4(1));"), ["image-write-bounds"]);
    assert_eq!(of("imageStore(t, ivec2(id - 1, 0), vec4(1));"), ["image-write-bounds"]);
    assert_eq!(of("imageStore(t, ivec2(id, 0), vec4(1));"), [""; 0]);
    assert_eq!(of("y[id] = imageLoad(t, ivec2(id, 2)).x;"), ["image-read-bounds"]);
    assert_eq!(of("y[id] = imageLoad(t, ivec2(id, 1)).x;"), [""; 0]);
    // Nothing depends on it where it is replaced.
    assert_eq!(of("float a = imageLoad(t, ivec2(id, 2)).x; y[id] = id < 2 ? 0.5 : a;"), [""; 0]);
    let counts =
        |body: &str| rules_of_image(", r32ui) uniform uimage2D t", body, image(Component::Uint32, 1));
    assert_eq!(counts("imageAtomicAdd(t, ivec2(0, 5), 1u);"), ["image-write-bounds"]);
    let used = counts("y[id] = float(imageAtomicAdd(t, ivec2(id, 5), 1u));");
    assert_eq!(used, ["image-write-bounds", "image-read-bounds"]);
    let layers = ImageShape { dimension: Dimension::D2Array, layers: 2, ..ImageShape::plane(4, 2) };
    let layered =
        || Descriptor::Image(Image::zeroed(Format::new(Component::Float32, 1), layers).expect("an image"));
    let layer = |at: u32| {
        let body = format!("imageStore(t, ivec3(id, 0, {at}), vec4(1));");
        rules_of_image(", r32f) uniform image2DArray t", &body, layered())
    };
    assert_eq!(layer(2), ["image-write-bounds"]);
    assert_eq!(layer(1), [""; 0]);
    let fetch = |at: &str| {
        let Descriptor::Image(image) = image(Component::Float32, 1) else { panic!("an image") };
        let bound = Descriptor::ImageSampler(image, Arc::new(Sampler::default()));
        rules_of_image(") uniform sampler2D t", &format!("y[id] = texelFetch(t, {at}).x;"), bound)
    };
    assert_eq!(fetch("ivec2(id, 0), 1"), ["image-read-bounds"]);
    assert_eq!(fetch("ivec2(id, 2), 0"), ["image-read-bounds"]);
    assert_eq!(fetch("ivec2(id, 1), 0"), [""; 0]);
}

/// Vulkan, "Image Writes", and for what is read this crate's choice: that of
/// `robustImageAccess2`.
#[test]
fn outside_an_image_the_run_goes_on() {
    let text = "layout(local_size_x = 4) in;
                layout(set = 0, binding = 0) buffer Y { float y[]; };
                layout(set = 0, binding = 1, r32f) uniform image2D t;
                layout(set = 0, binding = 2, r32ui) uniform uimageBuffer u;
                void main() {
                    int id = int(gl_LocalInvocationIndex);
                    imageStore(t, ivec2(id + 2, 1), vec4(id + 1));
                    vec4 outside = imageLoad(t, ivec2(id, 2));
                    y[id] = outside.x + outside.w + float(imageAtomicAdd(u, id + 3, 5u));
                }";
    let module = Arc::new(module(text));
    let compute =
        Compute::new(lower(&module, &module.entry_points[0]).expect("a program")).expect("a shader");
    let shape = ImageShape { dimension: Dimension::Buffer, ..ImageShape::plane(4, 1) };
    let [plane, counts] = [(Component::Float32, ImageShape::plane(4, 2)), (Component::Uint32, shape)]
        .map(|(component, shape)| Image::zeroed(Format::new(component, 1), shape).expect("an image"));
    let results = Buffer::zeroed(16);
    let resources = Resources::default()
        .bind(0, 0, Descriptor::Buffer(results.clone()))
        .bind(0, 1, Descriptor::Image(plane.clone()))
        .bind(0, 2, Descriptor::Image(counts.clone()));
    compute.run(&resources, [1; 3], RunOptions::default()).expect("a run");
    let texels = |image: &Image| -> Vec<u32> { bytemuck::pod_collect_to_vec(&image.bytes()) };
    let [one, two] = [1f32.to_bits(), 2f32.to_bits()];
    assert_eq!(texels(&plane), [0, 0, 0, 0, 0, 0, one, two]);
    assert_eq!(texels(&counts), [0, 0, 0, 5]);
    let read: Vec<f32> = bytemuck::pod_collect_to_vec(&results.bytes());
    // Zeros and an alpha of 1; the atomic instructions return 0, inside as well.
    assert_eq!(read, [1.0; 4]);
}

/// Entrances for one shader check what nothing reads, too, in every stage.
#[test]
fn single_shaders_are_checked_where_nothing_reads_a_value() {
    let load = |index: &str| {
        format!(
            "layout(set = 0, binding = 0) readonly buffer X {{ float x[]; }};
             layout(location = 0) rayPayloadInEXT vec4 color;
             void main() {{ float a = x[{index}]; color = vec4(0.5); }}"
        )
    };
    for stage in ["main.rmiss", "main.rchit", "main.rahit"] {
        let test = |index: &str| {
            let module = Arc::new(compiled(stage, &load(index)));
            let test = ShaderTest::new(&module, "main").expect("a shader").buffer(0, 0, &[1.0f32; 4]);
            test.payload(&[0.0f32; 4]).sanitize()
        };
        let error = test("gl_LaunchIDEXT.x + 4").expect_err("a load outside");
        assert!(error.trap().is_some(), "{stage}: {}", error.render());
        assert!(test("gl_LaunchIDEXT.x").is_ok(), "{stage}");
    }
    let text = |index: &str| {
        format!(
            "layout(local_size_x = 2) in;
             layout(set = 0, binding = 0) buffer X {{ float x[]; }};
             void main() {{ float a = x[{index}]; x[gl_LocalInvocationIndex] = 2.0; }}"
        )
    };
    let test = |index: &str| {
        let module = Arc::new(module(&text(index)));
        ComputeTest::new(&module, "main").expect("a shader").buffer(0, 0, &[1.0f32; 4])
    };
    assert!(test("90").run().is_ok());
    assert!(test("90").sanitize().expect_err("a load outside").trap().is_some());
    assert!(test("gl_LocalInvocationIndex").sanitize().is_ok());
}

/// What a shader hands to another one keeps the instruction that made a NaN.
#[test]
fn a_nan_is_followed_from_shader_to_shader() {
    let caller = "layout(set = 0, binding = 0) readonly buffer X { float x[]; };
                  layout(location = 0) callableDataEXT vec2 given;
                  void main() { given = vec2(1.0, x[0] / x[1]); executeCallableEXT(0, 0); }";
    let called = "layout(set = 0, binding = 1) buffer Y { uint y; };
                  layout(location = 0) callableDataInEXT vec2 given;
                  void main() { y = floatBitsToUint(given.y); }";
    let program = |name: &str, text: &str| {
        let module = Arc::new(compiled(name, text));
        lower(&module, &module.entry_points[0]).expect("a program")
    };
    let pipeline = Pipeline::builder()
        .ray_generation(program("main.rgen", caller))
        .and_then(|builder| builder.callable(program("main.rcall", called)))
        .and_then(|builder| builder.build())
        .and_then(|pipeline| pipeline.for_sanitizer())
        .expect("a pipeline");
    let plans: Vec<_> = pipeline.programs.iter().map(ProgramPlan::new).collect();
    let levels = Levels::default();
    let rules = |input: [f32; 2]| -> Vec<&'static str> {
        let resources = Resources::default().bind(0, 0, floats(&input)).bind(0, 1, floats(&[0.0]));
        let mut sanitizer = Sanitizer::new(&plans, &levels).of_pipeline(&pipeline);
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        launch.run_observed([1; 3], &mut |_| (), &mut sanitizer).expect("a launch");
        sanitizer.into_findings().iter().map(|finding| finding.rule.id).collect()
    };
    assert_eq!(rules([0.0, 0.0]), ["ulp-domain"]);
    assert_eq!(rules([3.0, 2.0]), [""; 0]);
    // The attributes of a hit are reported where they are handed over.
    let reports = "layout(set = 0, binding = 0) readonly buffer X { float x[]; };
                   hitAttributeEXT vec2 attributes;
                   void main() { attributes = vec2(1.0, x[0] / x[1]); reportIntersectionEXT(1.0, 0); }";
    let module = Arc::new(compiled("main.rint", reports));
    let test =
        |input: &[f32; 2]| ShaderTest::new(&module, "main").expect("a shader").buffer(0, 0, input).sanitize();
    let error = test(&[0.0, 0.0]).expect_err("a NaN in the attributes");
    assert!(error.message().contains("is in the attributes of a hit"), "{}", error.render());
    assert!(test(&[3.0, 2.0]).is_ok());
}
