//! Values of scene files as a shader's: each is taken exactly, or refused with a reason.
//!
//! The modules are `spirv-fixtures/pass/harness/conversions`; what a value becomes is computed from
//! its text by `conversions/rule.rs`.

use std::path::Path;
use std::sync::LazyLock;

use anyhit::{Buffer, Error, ErrorKind};
use anyhit_cases::expect::{Expectations, Observed, ObservedMemory};
use anyhit_engine::module::constant::ConstantValue;
use anyhit_scene::file::RayEntry;
use anyhit_scene::read::Document;
use anyhit_scene::{EmbeddedFiles, LoadOptions, ResolvedScene, assemble, load};
use dashu_ratio::RBig;
use proptest::prelude::*;

use crate::rust::conversions::rule::{
    BFLOAT, DOUBLE, E4M3, E5M2, Exact, FLOAT, HALF, Target, integer, of_toml, rule, values,
};

fn fixture(name: &str) -> Vec<u8> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/harness/conversions");
    std::fs::read(root.join(name)).expect("a fixture")
}

static TYPES: LazyLock<Vec<u8>> = LazyLock::new(|| fixture("types.comp.spv"));
static PAYLOAD: LazyLock<Vec<u8>> = LazyLock::new(|| fixture("payload.rchit.spv"));

fn resolve(text: &str) -> Result<ResolvedScene, Error> {
    let files = [("s.toml", text.as_bytes()), ("types.spv", &TYPES[..]), ("payload.spv", &PAYLOAD[..])];
    load(Path::new("s.toml"), &EmbeddedFiles(&files), &LoadOptions::default())
}

/// A scene that dispatches `types.comp`, with the keys of its shader, and tables.
fn types(shader: &str, tables: &str) -> String {
    format!(
        "version = 1\n{tables}\n[shaders.types]\npath = 'types.spv'\n{shader}\n[[dispatch]]\nshader = 'types'\n"
    )
}

/// The first bytes of the buffer at a binding.
fn buffer(scene: &ResolvedScene, binding: u32) -> Vec<u8> {
    let found = scene.resources.iter().find(|one| one.binding == binding).expect("a buffer");
    found.resource.data().and_then(|data| data.bytes()).expect("bytes").to_vec()
}

fn bits(bytes: &[u8], offset: usize, width: u32) -> u64 {
    let mut word = [0; 8];
    let size = width as usize / 8;
    word[..size].copy_from_slice(&bytes[offset..offset + size]);
    u64::from_le_bytes(word)
}

fn width(target: Target) -> u32 {
    match target {
        Target::Integer { width, .. } => width,
        Target::Float(format) => format.width,
        Target::Bool => 32,
    }
}

/// Typed data, by the names of their types.
const TYPED: [(&str, Target); 15] = [
    ("f16", HALF),
    ("f32", FLOAT),
    ("f64", DOUBLE),
    ("bf16", BFLOAT),
    ("e4m3", E4M3),
    ("e5m2", E5M2),
    ("u8", integer(8, false)),
    ("i8", integer(8, true)),
    ("u16", integer(16, false)),
    ("i16", integer(16, true)),
    ("u32", integer(32, false)),
    ("i32", integer(32, true)),
    ("u64", integer(64, false)),
    ("i64", integer(64, true)),
    ("bool", Target::Bool),
];

/// Members of `Block` in `types.comp`, with their offsets in std430.
const MEMBERS: [(&str, usize, Target); 10] = [
    ("u", 0, integer(32, false)),
    ("i", 4, integer(32, true)),
    ("f", 8, FLOAT),
    ("h", 28, HALF),
    ("d", 32, DOUBLE),
    ("i64", 40, integer(64, true)),
    ("u64", 48, integer(64, false)),
    ("u8", 200, integer(8, false)),
    ("i16", 202, integer(16, true)),
    // A bool of the source.
    ("flag", 304, integer(32, false)),
];

/// What the rule makes of a text; an integer that is not decimal is no float.
fn wanted(text: &str, target: Target, is_buffer: bool) -> Option<Exact> {
    let (given, is_radix) = of_toml(text);
    if is_radix && matches!(target, Target::Float(_)) {
        return None;
    }
    let taken = rule(&given, target, true, is_buffer);
    match taken {
        // The sign of an integer's zero stays.
        Some(Exact::Float(value, _)) if text.starts_with('-') => Some(Exact::Float(value, true)),
        other => other,
    }
}

/// Checks that a load took what it had to, and refused the rest at a place of the text.
fn agree(text: &str, found: Result<Exact, Error>, wanted: Option<Exact>) -> Result<(), TestCaseError> {
    match (&found, &wanted) {
        (Ok(found), Some(wanted)) => prop_assert_eq!(found, wanted, "{}", text),
        (Err(error), None) => {
            prop_assert_eq!(error.kind(), ErrorKind::InvalidScene, "{}", error.render());
            prop_assert!(error.render().contains("s.toml:"), "{}", error.render());
        }
        (Err(error), Some(wanted)) => {
            return Err(TestCaseError::fail(format!("{text} is {wanted:?}: {}", error.render())));
        }
        (Ok(found), None) => return Err(TestCaseError::fail(format!("{text} was taken as {found:?}"))),
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]

    #[test]
    fn typed_data_takes_what_the_rule_allows(text in values(), at in 0..TYPED.len()) {
        let (name, target) = TYPED[at];
        // An array of typed data is its elements, and a table may be no element.
        prop_assume!(!text.starts_with('['));
        let scene = format!("version = 1\n[resources.x]\ntype = 'buffer'\naddress = true\ndata = {{ {name} = {text} }}\n");
        let found = resolve(&scene).map(|scene| {
            let bytes = scene.unbound[0].data.bytes().expect("bytes").to_vec();
            Exact::of_bits(bits(&bytes, 0, width(target)), target)
        });
        agree(&format!("{name} = {text}"), found, wanted(&text, target, false))?;
    }

    #[test]
    fn expected_numbers_are_compared_with_what_the_rule_makes_of_them(
        text in values(), at in 0..TYPED.len() - 1, noise in any::<u64>(), is_exact in any::<bool>(),
    ) {
        let (name, target) = TYPED[at];
        prop_assume!(!text.starts_with('['));
        let value = wanted(&text, target, false);
        // What was found: what is expected where the type has it, or something else.
        let found = match (&value, is_exact) {
            (Some(value), true) => find_bits(value, target).unwrap_or(noise),
            _ => noise,
        } & (u64::MAX >> (64 - width(target)));
        let document = format!("[[expect.buffer]]\nname = 'x'\n{name} = {text}\n");
        let expected = Document::parse("s.toml", &document).and_then(|document| Expectations::read(&document));
        let vanishes = matches!(of_toml(&text).0, Exact::Float(..)) && value.is_none();
        match expected {
            Err(error) => prop_assert!(value.is_none(), "{name} = {text}: {}", error.render()),
            Ok(expected) => {
                let size = width(target) as usize / 8;
                let buffer = Buffer::new(&found.to_le_bytes()[..size]);
                let memory = ObservedMemory::of_buffer("x".into(), None, buffer);
                let observed = Observed { buffers: vec![memory], ..Observed::default() };
                let holds = expected.check(&observed).is_ok();
                let is_same = value.as_ref().is_some_and(|value| Exact::of_bits(found, target) == *value);
                // What rounds to 0 may be near to something, and is equal to nothing.
                prop_assert!(value.is_some() || vanishes, "{name} = {text} was taken");
                prop_assert_eq!(holds, is_same, "{} = {}, found {:?}", name, text, Exact::of_bits(found, target));
            }
        }
    }
}

/// The bits of a value in a type, by search; of an integer only some are found.
fn find_bits(value: &Exact, target: Target) -> Option<u64> {
    let Target::Float(format) = target else {
        let Exact::Integer(value) = value else { return None };
        return (0..1u64 << 9)
            .chain((0..64).flat_map(|shift| (0..3).map(move |less| (1u64 << shift).wrapping_sub(less))))
            .find(|bits| {
                Exact::of_bits(*bits & (u64::MAX >> (64 - width(target))), target)
                    == Exact::Integer(value.clone())
            });
    };
    let (negative, size) = match value {
        Exact::Float(value, negative) => (*negative, value.clone()),
        _ => return None,
    };
    let sign = u64::from(negative) << (format.width - 1);
    // Magnitudes ascend with their bits.
    let magnitude = if negative { -size } else { size };
    let (mut low, mut high) = (0u64, (1u64 << (format.width - 1)) - 1);
    while low < high {
        let middle = low + (high - low) / 2;
        match Exact::of_bits(middle, target) {
            Exact::Float(found, _) if found < magnitude => low = middle + 1,
            _ => high = middle,
        }
    }
    Some(sign | low)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, ..ProptestConfig::default() })]

    #[test]
    fn members_of_buffers_take_what_the_rule_allows(text in values(), at in 0..MEMBERS.len()) {
        let (name, offset, target) = MEMBERS[at];
        let tables = format!(
            "[resources.b]\ntype = 'storage_buffer'\nbinding = 0\ndata = {{ value = {{ {name} = {text} }}, rest = 'zeros' }}"
        );
        let found = resolve(&types("", &tables))
            .map(|scene| Exact::of_bits(bits(&buffer(&scene, 0), offset, width(target)), target));
        agree(&format!("{name} = {text}"), found, wanted(&text, target, true))?;
    }

    #[test]
    fn components_take_what_the_rule_allows(text in values(), at in 0usize..5) {
        // Of a vector, of a matrix by columns, of one by rows, of an array, of a struct's vector.
        let (value, offset) = [
            (format!("v3 = [0, {text}, 0]"), 20),
            (format!("cm = [[0, 0, 0], [0, 0, {text}]]"), 168 + 8),
            (format!("rm = [[0, 0, 0], [{text}, 0, 0]]"), 112 + 4),
            (format!("arr = [0, 0, 0, {text}, 0, 0]"), 272 + 12),
            (format!("inner = [{{ a = [0, 0, {text}], b = 0, c = 0 }}, {{ a = [0, 0, 0], b = 0, c = 0 }}]"), 208 + 8),
        ][at].clone();
        let tables = format!(
            "[resources.b]\ntype = 'storage_buffer'\nbinding = 0\ndata = {{ value = {{ {value} }}, rest = 'zeros' }}"
        );
        let found = resolve(&types("", &tables)).map(|scene| {
            let bytes = buffer(&scene, 0);
            let nonzero = bytes.chunks(4).position(|word| word != [0; 4]).map_or(offset, |word| 4 * word);
            Exact::of_bits(bits(&bytes, nonzero, 32), FLOAT)
        });
        agree(&value, found, wanted(&text, FLOAT, true))?;
    }

    #[test]
    fn push_constants_take_what_the_rule_allows(text in values(), at in 0usize..3) {
        let (value, offset, target) = [
            (format!("count = {text}"), 0, integer(32, false)),
            (format!("scale = {text}"), 4, FLOAT),
            (format!("off = [0, {text}]"), 12, integer(32, true)),
        ][at].clone();
        let push = format!("push_constants = {{ value = {{ {value} }}, rest = 'zeros' }}");
        let found = resolve(&types("", &push)).map(|scene| {
            let bytes = scene.push_constants.bytes().expect("bytes").to_vec();
            Exact::of_bits(bits(&bytes, offset, 32), target)
        });
        agree(&value, found, wanted(&text, target, true))?;
    }

    #[test]
    fn specialization_constants_take_what_the_rule_allows(text in values(), at in 0usize..3) {
        let (id, target) = [(3, integer(32, false)), (4, FLOAT), (5, Target::Bool)][at];
        // A table has a type.
        prop_assume!(!text.starts_with('{'));
        let found = resolve(&types(&format!("specialization = {{ {id} = {text} }}"), "")).and_then(|scene| {
            let (key, value) = &scene.dispatches[0].shader.specialization[0];
            let mut module = (*anyhit::Module::from_spirv(&TYPES).unwrap()).clone();
            value.specialize(&mut module, key, None)?;
            let constant = module.constants.iter().find(|one| one.spec_id == Some(id)).expect("a constant");
            let ConstantValue::Scalar(bits) = constant.value else { panic!("no scalar") };
            Ok(Exact::of_bits(bits, target))
        });
        agree(&format!("{id} = {text}"), found, wanted(&text, target, false))?;
    }
}

/// Whether typed data may lie where a member is declared: bytes may, and so may zeros, values of
/// the member's own type, integers of the other sign that it has, and bools in 32 bits.
fn may_lie(given: &Exact, from: Target, to: Target) -> bool {
    let is_zero = matches!(given, Exact::Integer(value) | Exact::Float(value, _) if *value == RBig::ZERO);
    match (from, to) {
        _ if is_zero || *given == Exact::Bool(false) || from == integer(8, false) => true,
        (Target::Bool, Target::Integer { width: 32, .. }) => true,
        (Target::Integer { .. }, Target::Integer { .. }) if width(from) == width(to) => {
            rule(given, to, true, true).is_some()
        }
        _ => from == to,
    }
}

#[test]
fn typed_data_has_the_types_that_shaders_declare() {
    for (name, from) in TYPED {
        for (member, offset, to) in MEMBERS {
            for text in ["0", "1", "-1", "0.5", "true", "false"] {
                let Some(given) = wanted(text, from, false) else { continue };
                let tables = format!(
                    "[resources.b]\ntype = 'storage_buffer'\nbinding = 0\n\
                     data = [{{ zeros = {offset} }}, {{ {name} = {text} }}]"
                );
                let found = resolve(&types("", &tables));
                let is_fine = may_lie(&given, from, to);
                assert_eq!(found.is_ok(), is_fine, "{name} = {text} for {member}: {found:?}");
                if let Err(error) = found {
                    let report = error.render();
                    let head = format!("`{member}` is ");
                    assert!(
                        report.contains(&head) && report.contains("s.toml:") && report.contains("help: "),
                        "{report}"
                    );
                }
            }
        }
    }
}

#[track_caller]
fn refused(text: &str, wanted: &[&str]) {
    let report = match resolve(text).and_then(|scene| assemble(&scene).map(drop)) {
        Ok(()) => panic!("it was taken:\n{text}"),
        Err(error) => error.render(),
    };
    for words in wanted {
        assert!(report.contains(words), "no `{words}` for\n{text}\n{report}");
    }
}

fn member(value: &str) -> String {
    let data = format!("data = {{ value = {{ {value} }}, rest = 'zeros' }}");
    types("", &format!("[resources.b]\ntype = 'storage_buffer'\nbinding = 0\n{data}"))
}

#[test]
fn numbers_out_of_range_are_refused() {
    refused(&member("u = -1"), &["uint ranges from 0 to 4294967295", "s.toml:5:"]);
    refused(&member("u = 4294967296"), &["uint ranges from 0 to 4294967295"]);
    refused(&member("u8 = 256"), &["uint8_t ranges from 0 to 255"]);
    refused(&member("i16 = 40000"), &["int16_t ranges from -32768 to 32767"]);
    refused(&member("i64 = 18446744073709551615"), &["int64_t ranges from"]);
    refused(&member("f = 1e40"), &["`1e40` is out of the range of float"]);
    refused(&member("h = 65520.0"), &["is out of the range of float16_t"]);
    refused(&member("d = 1e-400"), &["`1e-400` is too small for double: it rounds to 0"]);
    refused(
        &member("h = 2049"),
        &["`2049` is not exactly representable as float16_t: the nearest value is 2048"],
    );
    refused(&member("f = 0x10"), &["must be written in decimal", "help: write the number in decimal"]);
}

#[test]
fn kinds_do_not_mix() {
    refused(&member("u = 1.0"), &["`u` is uint: expected an integer, found a float"]);
    refused(&member("f = true"), &["`f` is float: expected a number, found a Boolean"]);
    // Compilers store bools as integers of 32 bits, and of no other size.
    refused(&member("u8 = true"), &["`u8` is uint8_t"]);
    refused(&types("specialization = { 5 = 1 }", ""), &["1 is neither true nor false: write `true`"]);
    refused(&types("specialization = { 3 = { f32 = 1.5 } }", ""), &["the f32 1.5 is not uint"]);
    refused(&types("specialization = { 3 = true }", ""), &["true is not a number"]);
}

#[test]
fn shapes_are_compared() {
    refused(&member("v3 = [1, 2]"), &["`v3` is vec3: expected 3 elements, found 2"]);
    refused(&member("cm = [[1, 2], [3, 4], [5, 6]]"), &["`cm` is mat2x3: expected 2 elements, found 3"]);
    refused(&member("arr = [[0, 0], [0, 0], [0, 0]]"), &["`arr[0]`"]);
    refused(&member("u = [1]"), &["`u` is uint: expected an integer, found an array"]);
    refused(&member("f = { f32 = [1, 2] }"), &["`f` is float of 4 bytes, but the piece has 8"]);
    refused(&member("f = { u32 = 1 }"), &["`f` is float: found the u32 1", "help: write `f32 = ...`"]);
    refused(&member("v3 = { u32 = [1, 2, 3] }"), &["`v3` is vec3: found the u32 1"]);
}

/// Rows of 12 bytes for a `vec3[]`, whose elements lie 16 bytes apart.
#[test]
fn strides_are_compared() {
    let vectors = |data: &str| {
        types("", &format!("[resources.v]\ntype = 'storage_buffer'\nbinding = 1\ndata = {{ {data} }}"))
    };
    refused(&vectors("f32 = [[1, 2, 3], [4, 5, 6]]"), &["the f32 4.0 at byte 12 is in padding", "help: "]);
    refused(&vectors("f64 = [[1, 2], [3, 4]]"), &["found the f64 1.0"]);
    refused(&vectors("u32 = [1, 2, 3]"), &["is float: found the u32 1", "help: write `f32 = ...`, or bytes"]);
    for data in ["f32 = [[1, 2, 3, 0], [4, 5, 6, 0]]", "value = [[1, 2, 3], [4, 5, 6]]"] {
        let bytes = buffer(&resolve(&vectors(data)).unwrap(), 1);
        assert_eq!(bytes[16..20], 4f32.to_le_bytes(), "{data}");
    }
    // Bytes are bytes.
    assert_eq!(buffer(&resolve(&vectors("hex = '01000000'")).unwrap(), 1), [1, 0, 0, 0]);
}

#[test]
fn push_constants_are_those_of_the_shader() {
    let long = format!("push_constants = {{ u32 = {:?} }}", [0; 100]);
    refused(&types("", &long), &["the push constants have 400 bytes, but the shaders declare 16", "help: "]);
    refused(
        &types("", "push_constants = { f32 = [7, 0.25, 0, 0] }"),
        &["`count` is uint: found the f32 7.0"],
    );
    refused(
        &types("", "push_constants = { value = { cuont = 1 } }"),
        &["no member `cuont`", "did you mean `count`?"],
    );
    refused(&types("", "push_constants = { value = { count = 1 } }"), &["missing value for `scale`, `off`"]);
}

/// `payload.rchit` takes a `vec3`, a `uint`, a bool and more, each in words of its own.
#[test]
fn payloads_of_rays_have_the_types_of_the_shaders() {
    let scene = |payload: &str| {
        let text = format!(
            "version = 1\n[shaders.main]\npath = 'payload.spv'\n[pipeline]\nhit = [{{ closest_hit = 'main' }}]\n\
             [geometry.t]\ntype = 'triangles'\nvertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]\n\
             [[instance]]\ngeometry = 't'\n\
             [[ray]]\norigin = [0, 0, 4]\ndirection = [0, 0, -1]\npayload = {payload}\n"
        );
        let scene = resolve(&text)?;
        let RayEntry::Given(ray) = &scene.rays[0] else { panic!("the ray has a pixel") };
        ray.operands(&assemble(&scene)?.pipeline).map(|operands| operands.payload)
    };
    let words = scene("[{ f32 = [1, 2, 3] }, { u32 = 7 }, { bool = true }]").unwrap();
    assert_eq!(words[2..5], [3f32.to_bits(), 7, 1]);
    assert_eq!(scene("{ hex = '01000000' }").unwrap()[0], 1);
    for (payload, wanted) in [
        ("{ u32 = [1, 2, 3] }", "`c` is float: found the u32 1"),
        ("[{ f32 = [1, 2, 3] }, { i32 = -1 }]", "`hits` is uint: found the i32 -1"),
        ("{ f64 = 1 }", "`c` is float: found the f64 1.0"),
    ] {
        let report = scene(payload).expect_err(payload).render();
        assert!(report.contains(wanted) && report.contains("s.toml:14:"), "{report}");
    }
}

/// `payload.rchit` has a record of a `uint` and a `float`.
#[test]
fn records_are_those_of_the_shader() {
    let scene = |record: &str| {
        format!(
            "version = 1\n[shaders.main]\npath = 'payload.spv'\n[pipeline]\n\
             hit = [{{ closest_hit = 'main', record = {record} }}]\n"
        )
    };
    for record in ["{ value = { id = 7, k = 0.5 } }", "[{ i32 = 7 }, { f32 = 0.5 }]", "{ u32 = [7, 0] }"] {
        let scene = resolve(&scene(record)).unwrap_or_else(|error| panic!("{record}\n{}", error.render()));
        let hit = scene.pipeline.sbt.hit[0].data.bytes().expect("bytes").to_vec();
        assert_eq!(hit[..4], 7u32.to_le_bytes(), "{record}");
    }
    refused(&scene("{ value = { id = -1, k = 0.5 } }"), &["uint ranges from 0 to 4294967295", "s.toml:5:"]);
    refused(&scene("{ value = { id = 1, k = 1e40 } }"), &["`1e40` is out of the range of float"]);
    refused(&scene("{ f32 = [7, 0.5] }"), &["`id` is uint: found the f32 7.0", "help: write `u32 = ...`"]);
    refused(&scene("{ value = { idd = 1, k = 0.5 } }"), &["no member `idd`", "did you mean `id`?"]);
}

#[test]
fn constants_that_no_shader_declares_are_refused() {
    refused(&types("specialization = { 99 = 1 }", ""), &["99"]);
    refused(
        &types("specialization = { SCC = 1 }", ""),
        &["no specialization constant named `SCC`", "SC (3)"],
    );
}

#[test]
fn expected_integers_are_integers() {
    for (text, wanted) in [
        ("u32 = 7.999", "expected an integer (u32), found a float"),
        ("u32 = nan", "expected an integer (u32), found a float"),
        ("u32 = -1", "u32 ranges from 0 to 4294967295"),
        ("u32 = 4294967296", "u32 ranges from 0 to 4294967295"),
        ("f32 = 1e40", "`1e40` is out of the range of f32"),
        ("f16 = 2049", "`2049` is not exactly representable as f16: the nearest value is 2048"),
        ("f32 = true", "expected a number, found a Boolean"),
    ] {
        let document =
            Document::parse("s.toml", &format!("[[expect.buffer]]\nname = 'x'\n{text}\n")).unwrap();
        let report = Expectations::read(&document).expect_err(text).render();
        assert!(report.contains(wanted) && report.contains("s.toml:3:"), "{text}: {report}");
    }
}

/// 2^53 and its successor are one f64; with a tolerance of 0 they are two integers.
#[test]
fn tolerances_of_integers_are_exact() {
    let document =
        Document::parse("s.toml", "[[expect.buffer]]\nname = 'x'\nu64 = 9007199254740992\nabsolute = 0.0\n")
            .unwrap();
    let expected = Expectations::read(&document).unwrap();
    for (found, holds) in [(1u64 << 53, true), ((1 << 53) + 1, false)] {
        let memory = ObservedMemory::of_buffer("x".into(), None, Buffer::new(&found.to_le_bytes()));
        let observed = Observed { buffers: vec![memory], ..Observed::default() };
        assert_eq!(expected.check(&observed).is_ok(), holds, "{found}");
    }
}

mod command_line {
    //! The flags of `anyhit run` that take values: the rule is that of scene files.

    use std::process::Command;

    use super::*;

    /// Runs `types.comp` with a flag; the words that it leaves in `outputs`, or what it prints.
    fn run(flag: &str, value: &str, folder: &Path) -> Result<Vec<u32>, String> {
        let out = folder.join("outputs.bin");
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let output = Command::new(env!("CARGO_BIN_EXE_anyhit"))
            .arg("run")
            .arg(root.join("spirv-fixtures/pass/harness/conversions/types.comp.spv"))
            .args(["--buffer=1=32", &format!("{flag}{value}")])
            .arg(format!("--dump=3={}", out.display()))
            .output()
            .expect("the command starts");
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned());
        }
        let bytes = std::fs::read(&out).expect("the dump");
        Ok(bytes.chunks(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 120, max_shrink_iters: 0, ..ProptestConfig::default() })]

        #[test]
        fn flags_take_what_the_rule_allows(text in values(), at in 0usize..7) {
            prop_assume!(!text.starts_with(['[', '{']));
            let (uint, bool) = (integer(32, false), Target::Bool);
            let (flag, value, word, target, is_buffer) = [
                ("--spec=", format!("3={text}"), 8, uint, false),
                ("--spec=", format!("SF={text}"), 9, FLOAT, false),
                ("--spec=", format!("SB = {text}"), 10, bool, false),
                ("--push=", format!("[{{ u32 = {text} }}, {{ zeros = 12 }}]"), 6, uint, false),
                ("--push=", format!("value = {{ scale = {text} }}, rest = 'zeros'"), 7, FLOAT, true),
                ("--buffer=", format!("0=value = {{ i = {text} }}, rest = 'zeros'"), 1, integer(32, true), true),
                ("--buffer=", format!("0,3=[{{ zeros = 60 }}, {{ u32 = {text} }}]"), 15, uint, false),
            ][at].clone();
            let folder = tempfile::tempdir().unwrap();
            let found = run(flag, &value, folder.path());
            let wanted = wanted(&text, target, is_buffer);
            match (&found, &wanted) {
                (Ok(words), Some(wanted)) => {
                    prop_assert_eq!(&Exact::of_bits(words[word].into(), target), wanted, "{}{}", flag, value);
                }
                (Err(report), None) => {
                    prop_assert!(report.contains("error: ") && report.contains("the command line:"), "{report}");
                }
                _ => return Err(TestCaseError::fail(format!("{flag}{value}: {found:?}, and not {wanted:?}"))),
            }
        }
    }

    #[test]
    fn other_types_than_the_shader_s_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        for (flag, value, wanted) in [
            ("--buffer=", "0,3=f32 = [1.5]", "is uint: found the f32 1.5"),
            ("--push=", "f32 = [7, 0.25]", "`count` is uint: found the f32 7.0"),
            ("--push=", "u32 = [1, 0, 0, 0, 0, 0, 0, 0, 0, 0]", "the shaders declare 16"),
            ("--spec=", "5=1", "write `true`"),
        ] {
            let report = run(flag, value, folder.path()).expect_err(value);
            assert!(report.contains(wanted), "{flag}{value}: {report}");
        }
        assert_eq!(
            run("--buffer=", "0,3=[{ zeros = 60 }, { u8 = [0, 0, 192, 63] }]", folder.path()).unwrap()[15],
            0x3FC0_0000
        );
    }
}
