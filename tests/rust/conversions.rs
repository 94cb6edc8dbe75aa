//! Values of Rust as a shader's: each is taken exactly, or refused with a reason.
//!
//! The modules are `spirv-fixtures/pass/harness/conversions`; the values follow from their sources.

pub mod rule;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use anyhit::{
    ComputeTest, ErrorKind, Hit, LoadedScene, Module, NestedScalars, Program, Ray, ScalarValue, ShaderTest,
    StructData, Value, assert_near, assert_payload_eq, assert_ulps,
};

fn module(name: &str) -> Arc<Module> {
    let root =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/harness/conversions");
    Module::open(root.join(name)).expect("a fixture")
}

/// 7, 2^32 - 1 and 0, as a shader wrote them.
fn numbers() -> Value {
    const SOURCE: &str = "@group(0) @binding(0) var<storage, read_write> o: array<u32, 3>;
        @compute @workgroup_size(1) fn main() { o[0] = 7u; o[1] = 4294967295u; o[2] = 0u; }";
    let module = Module::from_source("numbers.wgsl", SOURCE).unwrap();
    let outcome = ComputeTest::new(&module, "main").unwrap().buffer(0, 0, &[0u32; 3]).run().unwrap();
    outcome.buffer(0, 0).unwrap()["_0"].clone()
}

/// The message of an assertion that must fail.
fn refused(assertion: impl FnOnce()) -> String {
    let panic = catch_unwind(AssertUnwindSafe(assertion)).expect_err("it passed, and must not");
    panic.downcast_ref::<String>().expect("a formatted message").clone()
}

fn block() -> StructData {
    StructData::buffer(&module("types.comp.spv"), 0, 0).unwrap()
}

fn types_of(module: &Arc<Module>) -> ComputeTest {
    ComputeTest::of(Program::of(module, "main").unwrap())
        .unwrap()
        .buffer(0, 0, block().bytes())
        .buffer(0, 1, &[[0f32; 4]; 2])
        .buffer(0, 3, &[0u32; 16])
        .push_constants(&[0u32; 4])
        .buffer(0, 2, StructData::buffer(module, 0, 2).unwrap().bytes())
}

fn types() -> ComputeTest {
    types_of(&module("types.comp.spv"))
}

fn payload() -> ShaderTest {
    let triangle = Hit::triangle([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]);
    ShaderTest::new(&module("payload.rchit.spv"), "main")
        .unwrap()
        .hit(triangle.ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0])))
        .buffer(0, 1, &[0u32; 8])
        .shader_record(&[2u32, 0])
        .push_constants(&[5u32, 0])
}

/// The message of an error that a value which does not fit must be.
fn message<T: std::fmt::Debug>(result: anyhit::Result<T>) -> String {
    let error = result.expect_err("it was taken");
    assert_eq!(error.kind(), ErrorKind::InvalidArgument, "{}", error.render());
    error.render()
}

#[test]
fn integers_are_compared_with_any_number_exactly() {
    let numbers = numbers();
    assert_ulps!(numbers[0], 7, 0);
    assert_near!(numbers[1], 4294967295.0f64, absolute = 0.0);
    assert!(refused(|| assert_ulps!(numbers[0], 7.999f64, 0)).contains("expected 7.999, found 7"));
    refused(|| assert_near!(numbers[0], 4294967303.0f64, absolute = 0.0));
    refused(|| assert_ulps!(numbers[1], -1.5f32, 0));
    refused(|| assert_ulps!(numbers[1], -1, 0));
    refused(|| assert_ulps!(numbers[2], f32::NAN, 0));
    refused(|| assert_near!(numbers[2], f32::NAN, absolute = 1e30, relative = 1e30));
}

#[test]
fn nothing_finite_is_near_infinity() {
    assert_near!(f32::INFINITY, f32::INFINITY, relative = 1e-6);
    refused(|| assert_near!(1.0f32, f32::INFINITY, relative = 1e-6));
    refused(|| assert_near!(f32::NEG_INFINITY, f32::INFINITY, relative = 1e-6));
    refused(|| assert_near!(f32::INFINITY, 1.0f32, absolute = f64::INFINITY));
    refused(|| assert_ulps!(f32::INFINITY, 1e300f64, 1e300));
    refused(|| assert_ulps!(1.0f32, f32::INFINITY, 1e300));
}

#[test]
fn numbers_out_of_range_are_refused() {
    for (path, value) in [("u", -1), ("u8", -1), ("u8", 256), ("i16", 40000), ("i16", -32769)] {
        let text = message(block().set(path, value));
        assert!(
            text.contains(&format!("`{path}` of struct Block: {value} is out of the range of ")),
            "{text}"
        );
    }
    assert!(message(block().set("i64", u64::MAX)).contains("to 9223372036854775807"));
    assert!(block().set("u64", u64::MAX).unwrap().set("i16", -32768).is_ok());
    for (path, value) in [("f", 1e300), ("f", -3.5e38), ("h", 1e6), ("h", 65520.0), ("f", 1e-300)] {
        message(block().set(path, value));
    }
    assert_eq!(block().set("h", 65504.0).unwrap().value()["h"].f32(), 65504.0);
    message(payload().payload_member("hits", -1).run());
    message(payload().builtin("RayTmaxKHR", 1e300).run());
    message(payload().builtin("InstanceCustomIndexKHR", 1u64 << 32).run());
    let outcome = payload().payload_member("hits", u32::MAX - 7).run().unwrap();
    refused(|| assert_payload_eq!(outcome, { "hits": -1 }));
    assert_payload_eq!(outcome, { "hits": u32::MAX });
}

/// Whoever makes values at run time, from a file for one, makes the nesting, too.
#[test]
fn nestings_are_values() {
    let one = |value: f64| NestedScalars::One(ScalarValue::from(value));
    let data = block().set("v3", NestedScalars::Many(vec![one(1.0), one(2.0), one(3.0)])).unwrap();
    assert_eq!(data.value()["v3"].vec3(), [1.0, 2.0, 3.0]);
    message(block().set("v3", NestedScalars::Many(vec![one(1.0)])));
}

/// `VkBorderColor`: a sampler has transparent black unless it says another.
#[test]
fn samplers_have_a_border() {
    assert_eq!(anyhit::Sampler::default().border_color, anyhit::BorderColor::TransparentBlack);
}

#[test]
fn kinds_do_not_mix() {
    for text in [
        message(block().set("f", 1)),
        message(block().set("u", 1.0)),
        message(block().set("v3", [1, 2, 3])),
        message(payload().payload_member("flag", 1).run()),
        message(payload().payload_member("hits", true).run()),
    ] {
        assert!(text.contains(", not "), "{text}");
    }
    // Compilers store the bools of a buffer as 32-bit integers.
    let data = block().set("flag", true).unwrap().set("bb", [true, false]).unwrap();
    assert_eq!((data.value()["flag"].u32(), data.value()["bb"].uvec::<2>()), (1, [1, 0]));
}

#[test]
fn shapes_are_compared() {
    let text = message(block().set("cm", [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]));
    assert!(text.contains("which requires [[float; 3]; 2], not [[float; 2]; 3]"), "{text}");
    message(block().set("cm", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    message(block().set("arr", [[0.0; 2]; 3]));
    message(block().set("u", [1]));
    message(block().set("inner[0]", [0.0; 5]));
    let outcome = payload().run().unwrap();
    refused(|| assert_payload_eq!(outcome, { "m": [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]] }));
    assert_payload_eq!(outcome, { "m": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]] });
    // Rows, as `Instance::transform` takes them, for four columns.
    let rows = [[1.0f32, 0.0, 0.0, 10.0], [0.0, 1.0, 0.0, 20.0], [0.0, 0.0, 1.0, 30.0]];
    let test = ShaderTest::new(&module("object_to_world.rchit.spv"), "main").unwrap();
    message(test.clone().builtin("ObjectToWorldKHR", rows).run());
    let columns = [[1.0f32, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [10.0, 20.0, 30.0]];
    let outcome = test.builtin("ObjectToWorldKHR", columns).run().unwrap();
    assert_eq!(outcome.payload.matrix::<4, 3>()[3], [10.0, 20.0, 30.0]);
}

#[test]
fn a_path_into_a_row_major_matrix_is_a_column() {
    let data = block().set("rm[1]", [7.0, 8.0, 9.0]).unwrap();
    assert_eq!(data.value()["rm"].matrix::<2, 3>(), [[0.0; 3], [7.0, 8.0, 9.0]]);
    let data = data.set("rm[0][2]", 5.0).unwrap();
    assert_eq!(data.value()["rm"].matrix::<2, 3>(), [[0.0, 0.0, 5.0], [7.0, 8.0, 9.0]]);
    message(block().set("rm[1]", 9.0));
    message(block().set("rm[2]", [7.0, 8.0, 9.0]));
}

#[test]
fn components_have_names() {
    let data =
        block().set("v3.z", 3.0).unwrap().set("inner[1].a.x", 1.0).unwrap().set("rm[1].y", 5.0).unwrap();
    assert_eq!(data.value()["v3"].vec3(), [0.0, 0.0, 3.0]);
    assert_eq!(data.value()["inner"][1]["a"].vec3(), [1.0, 0.0, 0.0]);
    assert_eq!(data.value()["rm"].matrix::<2, 3>()[1], [0.0, 5.0, 0.0]);
    message(block().set("v3.w", 1.0));
    let outcome = payload().payload_member("m[1].y", 2.0).run().unwrap();
    assert_eq!(outcome.payload["m"].matrix::<2, 3>()[1], [0.0, 2.0, 0.0]);
}

/// Three columns 16 bytes apart are nine numbers.
#[test]
fn matrices_are_read_as_they_print() {
    let columns = [[1f32, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]];
    let value = block().set("m3", columns).unwrap().value();
    assert_eq!(value["m3"].read::<[[f32; 3]; 3]>().unwrap(), columns);
}

#[test]
fn runtime_arrays_grow_to_what_is_set() {
    let data = StructData::buffer(&module("types.comp.spv"), 0, 1).unwrap();
    let data = data.set("v", vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]).unwrap();
    assert_eq!((data.bytes().len(), data.value()["v"][1].vec3()), (32, [4.0, 5.0, 6.0]));
}

#[test]
fn strides_are_compared() {
    let rows = [[10f32, 11.0, 12.0], [20.0, 21.0, 22.0], [30.0, 31.0, 32.0], [40.0, 41.0, 42.0]];
    let text = message(types().buffer(0, 1, &rows).run());
    assert!(text.contains("elements are 12 bytes apart, but 16 in the shader"), "{text}");
    message(types().buffer(0, 1, &[[0f32; 3]; 4]).run());
    message(types().buffer(0, 1, &[[[0f32; 3]; 2]; 2]).run());
    message(types().buffer(0, 1, &[[1.0f64; 2]; 2]).run());
    // The fourth would be dropped.
    let text = message(types().buffer(0, 1, &[[1f32, 2.0, 3.0, 4.0]; 2]).run());
    assert!(text.contains("the f32 4.0 at offset 12 is in padding"), "{text}");
    let padded = types().buffer(0, 1, &[[1f32, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]]).run().unwrap();
    assert_eq!(padded.read_buffer::<u32>(0, 3).unwrap()[3..5], [2, 4f32.to_bits()]);
    // Bytes are bytes.
    assert!(types().buffer_bytes(0, 1, &[1; 48]).run().is_ok());
}

#[test]
fn scalars_of_records_and_constants_are_compared() {
    let text = message(types().push_constants(&[7.0f32, 0.25, 0.0, 0.0]).run());
    assert!(text.contains("`count` is uint, given as `f32`"), "{text}");
    message(types().push_constants(&[7u32, 0.25f32.to_bits(), 0, 0]).run());
    message(types().push_constants(&[7u32, 0, u32::MAX, 0]).run());
    assert!(types().push_constants(&[7i32, 0, -1, 0]).run().is_ok());
    message(types().push_constants(&[-7i32, 0, 0, 0]).run());
    message(payload().shader_record(&[2.0f32, 0.5]).run());
    let record = [2u32.to_le_bytes(), 0.5f32.to_le_bytes()].concat();
    assert!(payload().shader_record_bytes(&record).run().is_ok());
    message(payload().attributes(&[1u32, 2]).run());
    message(payload().trace_answers(&[[1.0f64; 4]]).push_constants_bytes(&[0, 0, 0, 0, 0, 0, 128, 63]).run());
}

#[test]
fn sizes_and_structs_are_compared() {
    let other = StructData::buffer(&module("types.comp.spv"), 0, 2).unwrap();
    message(types().push_constants_data(&other).run());
    message(types().push_constants(&[[7u32; 10]; 10]).run());
    message(types().buffer(0, 3, &[0u32; 15]).run());
    message(types().buffer(0, 3, &[0u32; 64]).run());
    let own = StructData::push_constants(&module("types.comp.spv")).unwrap().set("scale", 0.5).unwrap();
    assert!(types().push_constants_data(&own).run().is_ok());
}

/// A struct of Rust with `Debug` tells its classes; sizes are those that make it the shader's.
#[test]
fn fields_of_structs_are_compared() {
    #[repr(C)]
    #[derive(Clone, Copy, Debug, bytemuck::NoUninit)]
    struct Constants {
        count: u32,
        scale: f32,
        offset: [i32; 2],
    }
    #[repr(C)]
    #[derive(Clone, Copy, Debug, bytemuck::NoUninit)]
    struct Swapped {
        scale: f32,
        count: u32,
        offset: [i32; 2],
    }
    let good = Constants { count: 3, scale: 0.25, offset: [-1, 1] };
    let outcome = types().push_constants(&good).run().unwrap();
    assert_eq!(outcome.read_buffer::<u32>(0, 3).unwrap()[6..8], [3, 0.25f32.to_bits()]);
    let swapped = Swapped { scale: 0.25, count: 3, offset: [-1, 1] };
    let text = message(types().push_constants(&swapped).run());
    assert!(text.contains("the scalars of `Swapped` differ from those of the shader's"), "{text}");
}

#[test]
fn specialization_takes_values_of_the_constant() {
    let mut module = (*module("types.comp.spv")).clone();
    for error in [
        module.specialize(3, -1).unwrap_err(),
        module.specialize(3, 1.0).unwrap_err(),
        module.specialize(4, 2).unwrap_err(),
        module.specialize(4, 1e39).unwrap_err(),
        module.specialize(5, 1).unwrap_err(),
        module.specialize(6, 1).unwrap_err(),
    ] {
        assert_eq!(error.kind(), ErrorKind::InvalidArgument, "{}", error.render());
    }
    module.specialize(3, 7).unwrap();
    module.specialize(4, 2.0).unwrap();
    module.specialize(5, false).unwrap();
    let outcome = types_of(&Arc::new(module)).run().unwrap();
    assert_eq!(outcome.read_buffer::<u32>(0, 3).unwrap()[8..11], [7, 2f32.to_bits(), 0]);
}

#[test]
fn values_are_equal_where_they_print_alike() {
    let mut bytes = block().bytes().to_vec();
    bytes[76] = 9; // The padding of the first column of `m3`.
    let plain = types().run().unwrap().buffer(0, 0).unwrap();
    let padded = types().buffer(0, 0, &bytes).run().unwrap().buffer(0, 0).unwrap();
    assert_eq!(format!("{plain:?}"), format!("{padded:?}"));
    assert!(plain == padded);
    let set = |value: f32| block().set("f", value).unwrap().value();
    assert!(set(f32::NAN) == set(-f32::NAN) && set(0.0) != set(-0.0) && set(1.0) != set(2.0));
}

#[test]
fn a_trace_that_nothing_answers_leaves_the_payload() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass");
    let module = Module::open(root.join("frames/ping-pong/primary.rgen.spv")).unwrap();
    let format = anyhit::Format::new(anyhit::Component::Float32, 1);
    let image = anyhit::Image::plane(format, 4, 1).unwrap();
    let test = ShaderTest::new(&module, "main").unwrap().launch([2, 0, 0], [4, 1, 1]).image(0, 2, image);
    let outcome = test.run().unwrap();
    assert_eq!(outcome.traces.len(), 1);
}

#[test]
fn a_loaded_scene_refuses_what_no_shader_declares() {
    let scene = || {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        LoadedScene::open(root.join("shaders/pass/ray-query/compute/scene.toml")).unwrap()
    };
    message(scene().set_buffer("outputs", &[0u32; 2]).map(|_| ()));
    message(scene().set_push_constants(&[7u32; 4]).map(|_| ()));
    message(scene().set_launch_size([100, 100]).map(|_| ()));
}

mod random {
    //! Random scalars for every scalar type, through every entrance, against the rule in rational
    //! numbers.

    use dashu_ratio::RBig;
    use proptest::prelude::*;

    use super::rule::{DOUBLE, Exact, FLOAT, HALF, Target, integer};
    use super::*;

    /// Members of `Block` in `types.comp`.
    const MEMBERS: [(&str, Target); 9] = [
        ("u", integer(32, false)),
        ("i", integer(32, true)),
        ("u8", integer(8, false)),
        ("i16", integer(16, true)),
        ("i64", integer(64, true)),
        ("u64", integer(64, false)),
        ("f", FLOAT),
        ("h", HALF),
        ("d", DOUBLE),
    ];

    /// What the rule makes of a value of Rust.
    fn taken(value: ScalarValue, target: Target, is_buffer: bool) -> Option<Exact> {
        let given = match value {
            ScalarValue::Int(value) => Exact::Integer(RBig::from(value)),
            ScalarValue::Uint(value) => Exact::Integer(RBig::from(value)),
            ScalarValue::Bool(value) => Exact::Bool(value),
            ScalarValue::Float(value) => Exact::of_float(value.into()),
            ScalarValue::Double(value) => Exact::of_float(value),
            other => panic!("{other:?}"),
        };
        rule::rule(&given, target, false, is_buffer)
    }

    fn read(value: &Value, target: Target) -> Exact {
        match target {
            Target::Integer { .. } => Exact::Integer(RBig::from(value.integer())),
            Target::Float(_) => Exact::of_float(value.f64()),
            Target::Bool => Exact::Bool(value.bool()),
        }
    }

    /// Scalars, many of them near the ends of ranges.
    fn scalar() -> impl Strategy<Value = ScalarValue> {
        let near = (prop_oneof![Just(0u32), 7u32..18, 31u32..34, 63u32..65], -2i128..3, any::<bool>());
        let whole = near.prop_map(|(shift, delta, negative)| {
            let value = (1i128 << shift) + delta;
            let value = if negative { -value } else { value };
            let value = value.clamp(i64::MIN.into(), u64::MAX.into());
            u64::try_from(value).map_or(ScalarValue::Int(value as i64), ScalarValue::Uint)
        });
        let edge = (-1080i32..1024, -3i64..4, any::<bool>()).prop_map(|(exponent, ulps, negative)| {
            let value = f64::from_bits((2f64.powi(exponent).to_bits() as i64 + ulps).max(0) as u64);
            ScalarValue::Double(if negative { -value } else { value })
        });
        prop_oneof![
            3 => whole,
            3 => edge,
            1 => any::<u64>().prop_map(|bits| ScalarValue::Double(f64::from_bits(bits))),
            1 => any::<u32>().prop_map(|bits| ScalarValue::Float(f32::from_bits(bits))),
            1 => any::<i64>().prop_map(ScalarValue::Int),
            1 => any::<bool>().prop_map(ScalarValue::Bool),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

        #[test]
        fn members_of_blocks_take_what_the_rule_allows(value in scalar(), member in 0..MEMBERS.len()) {
            let (path, target) = MEMBERS[member];
            let found = block().set(path, value).ok().map(|data| read(&data.value()[path], target));
            prop_assert_eq!(found, taken(value, target, true), "{}", path);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 500, ..ProptestConfig::default() })]

        #[test]
        fn payloads_take_what_the_rule_allows(value in scalar(), member in 0usize..4) {
            let (path, target) = [("hits", integer(32, false)), ("h", HALF), ("i", integer(64, true)), ("flag", Target::Bool)][member];
            let given = payload().payload_member(path, value).run().ok();
            // The shader counts: `hits` by 5 + 2, `i` by -1.
            let wraps = |whole: RBig, bits: i64, least: RBig| {
                let count = rule::two_to(bits);
                let turns = RBig::from(((whole.clone() - least) / count.clone()).floor());
                Exact::Integer(whole - turns * count)
            };
            let wanted = taken(value, target, false).map(|value| match (path, value) {
                ("hits", Exact::Integer(hits)) => wraps(hits + RBig::from(7), 32, RBig::ZERO),
                ("i", Exact::Integer(i)) => wraps(i - RBig::ONE, 64, -rule::two_to(63)),
                (_, other) => other,
            });
            let found = given.map(|outcome| read(&outcome.payload[path], target));
            prop_assert_eq!(found, wanted, "{}", path);
        }

        #[test]
        fn specialization_constants_take_what_the_rule_allows(value in scalar(), constant in 0usize..3) {
            let (id, target) = [(3, integer(32, false)), (4, FLOAT), (5, Target::Bool)][constant];
            let mut module = (*module("types.comp.spv")).clone();
            let found = module.specialize(id, value).ok().map(|()| {
                let outcome = types_of(&Arc::new(module)).run().unwrap();
                let word = outcome.read_buffer::<u32>(0, 3).unwrap()[8 + constant];
                match constant {
                    0 => Exact::Integer(RBig::from(word)),
                    1 => Exact::of_float(f32::from_bits(word).into()),
                    _ => Exact::Bool(word != 0),
                }
            });
            prop_assert_eq!(found, taken(value, target, false), "{}", id);
        }

        #[test]
        fn builtins_take_what_the_rule_allows(value in scalar()) {
            let test = payload().builtin("RayTmaxKHR", value);
            let found = test.run().ok().map(|outcome| Exact::of_float(outcome.payload["c"].vec3()[2].into()));
            prop_assert_eq!(found, taken(value, FLOAT, false));
        }
    }
}
