//! `crates/engine/src/module/validate/grammar_delta.rs` is what SPIR-V's grammar says and rspirv's
//! tables lack.
//!
//! `ANYHIT_SPIRV_GRAMMAR=spirv.core.grammar.json ANYHIT_VK_XML=vk.xml cargo test --test main
//! grammar_delta::` compares the table with both registries, which the Khronos Group publishes in
//! SPIRV-Headers and Vulkan-Docs; with `BLESS=1` it writes the table. Without them the test is
//! skipped.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhit_engine::module::Opcode;
use rspirv::{dr, grammar, spirv};
use serde_json::Value;

use crate::support::skipped::{skipped, test_name};

const TABLE: &str = "crates/engine/src/module/validate/grammar_delta.rs";

#[test]
fn the_table_is_what_rspirv_lacks_of_the_grammar() {
    let (Some(grammar), Some(vulkan)) =
        (std::env::var_os("ANYHIT_SPIRV_GRAMMAR"), std::env::var_os("ANYHIT_VK_XML"))
    else {
        return skipped(test_name!(), "ANYHIT_SPIRV_GRAMMAR and ANYHIT_VK_XML name no registries");
    };
    let grammar = fs::read_to_string(grammar).expect("the grammar");
    let grammar: Value = serde_json::from_str(&grammar).expect("JSON");
    let vulkan = fs::read_to_string(vulkan).expect("vk.xml");
    let table = table(&grammar, &vulkan);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(TABLE);
    if std::env::var_os("BLESS").is_some() {
        fs::write(&path, &table).expect("a writable table");
    }
    assert!(fs::read_to_string(&path).expect("the table") == table, "BLESS=1 writes {TABLE} again");
}

/// The operands of instructions that rspirv lacks are written by hand.
#[test]
fn added_opcodes_have_the_operands_of_the_grammar() {
    let Some(grammar) = std::env::var_os("ANYHIT_SPIRV_GRAMMAR") else {
        return skipped(test_name!(), "ANYHIT_SPIRV_GRAMMAR names no registry");
    };
    let grammar = fs::read_to_string(grammar).expect("the grammar");
    let grammar: Value = serde_json::from_str(&grammar).expect("JSON");
    let mut count = 0;
    for instruction in grammar["instructions"].as_array().expect("a list") {
        let number = instruction["opcode"].as_u64().expect("a number");
        if spirv::Op::from_u32(number as u32).is_some() {
            continue;
        }
        let operands = instruction["operands"].as_array().into_iter().flatten();
        let expected = operands.map(|one| {
            let quantifier = match one["quantifier"].as_str() {
                None => "One",
                Some("?") => "ZeroOrOne",
                Some(_) => "ZeroOrMore",
            };
            format!("{} {quantifier}", one["kind"].as_str().expect("a kind"))
        });
        let opcode = Opcode(number as u16);
        let found = opcode.operands().iter().map(|one| format!("{:?} {:?}", one.kind, one.quantifier));
        assert_eq!(opcode.to_string(), instruction["opname"].as_str().expect("a name"));
        assert_eq!(found.collect::<Vec<_>>(), expected.collect::<Vec<_>>(), "{opcode}");
        count += 1;
    }
    assert!(count > 10, "{count}");
}

/// What the grammar says of one name.
struct Entry {
    number: u32,
    name: String,
    capabilities: Vec<u32>,
    extensions: Vec<String>,
    /// The minor version of SPIR-V 1 that has it without an extension; `None` where none has.
    since: Option<u32>,
    /// The last minor version that has it.
    until: Option<u32>,
}

/// What rspirv says of one name: capabilities and extensions.
type Known = (Vec<u32>, Vec<String>);

impl Entry {
    fn of(value: &Value, name: &str, number: u32, capabilities: &BTreeMap<String, u32>) -> Self {
        let texts = |key: &str| -> Vec<String> {
            let all = value[key].as_array().into_iter().flatten();
            all.map(|one| one.as_str().expect("a text").to_owned()).collect()
        };
        let minor = |text: &str| text.strip_prefix("1.").map(|minor| minor.parse().expect("a version"));
        Self {
            number,
            name: name.to_owned(),
            capabilities: texts("capabilities").iter().map(|name| capabilities[name]).collect(),
            extensions: texts("extensions"),
            since: minor(value["version"].as_str().unwrap_or("1.0")),
            until: value["lastVersion"].as_str().and_then(minor),
        }
    }

    /// Whether rspirv says the same.
    fn is_known(&self, known: Option<&Known>) -> bool {
        let sorted = |mut all: Vec<u32>| {
            all.sort_unstable();
            all
        };
        let sorted_texts = |mut all: Vec<String>| {
            all.sort_unstable();
            all
        };
        known.is_some_and(|(capabilities, extensions)| {
            sorted(capabilities.clone()) == sorted(self.capabilities.clone())
                && sorted_texts(extensions.clone()) == sorted_texts(self.extensions.clone())
        })
    }

    /// The first version, where it does not follow from the extensions: with extensions none, else
    /// 1.0.
    fn exceptional_version(&self) -> Option<u32> {
        let usual = if self.extensions.is_empty() { Some(0) } else { None };
        self.since.filter(|_| self.since != usual)
    }

    fn row(&self) -> String {
        format!(
            "    entry({}, {:?}, &{:?}, &{:?}),\n",
            self.number, self.name, self.capabilities, self.extensions
        )
    }
}

/// The entries of a grammar's list; a number that has several names counts once.
fn entries(list: &Value, name: &str, number: &str, capabilities: &BTreeMap<String, u32>) -> Vec<Entry> {
    let mut all = BTreeMap::new();
    for one in list.as_array().expect("a list") {
        let number = match &one[number] {
            Value::String(hex) => u32::from_str_radix(hex.trim_start_matches("0x"), 16).expect("hexadecimal"),
            number => number.as_u64().and_then(|number| u32::try_from(number).ok()).expect("a number"),
        };
        let full = one[name].as_str().expect("a name");
        let name = if name == "opname" { full.strip_prefix("Op").unwrap_or(full) } else { full };
        all.entry(number).or_insert_with(|| Entry::of(one, name, number, capabilities));
    }
    all.into_values().collect()
}

/// Numbers by version, as rows.
fn versions(entries: &[&Entry], version: impl Fn(&Entry) -> Option<u32>) -> BTreeMap<u32, Vec<u32>> {
    let mut all: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for entry in entries {
        if let Some(version) = version(entry) {
            all.entry(version).or_default().push(entry.number);
        }
    }
    all
}

fn table(grammar: &Value, vulkan: &str) -> String {
    let mut capabilities = BTreeMap::new();
    let kinds = grammar["operand_kinds"].as_array().expect("kinds");
    let enumerants = |kind: &str| {
        let found = kinds.iter().find(|one| one["kind"] == kind).expect("the kind");
        &found["enumerants"]
    };
    for one in enumerants("Capability").as_array().expect("a list") {
        let number = one["value"].as_u64().and_then(|number| u32::try_from(number).ok()).expect("a number");
        let aliases = one["aliases"].as_array().into_iter().flatten();
        for name in std::iter::once(&one["enumerant"]).chain(aliases) {
            capabilities.insert(name.as_str().expect("a name").to_owned(), number);
        }
    }
    let mut text = format!(
        "//! What the grammar of SPIR-V {}.{}, revision {}, says and rspirv's tables lack.\n//!\n\
         //! Generated: `tests/modules/grammar_delta.rs` says how, and compares.\n\n\
         use super::entry::{{Entry, Kind, entry}};\n",
        grammar["major_version"], grammar["minor_version"], grammar["revision"]
    );
    let opcodes = entries(&grammar["instructions"], "opname", "opcode", &capabilities);
    let known: BTreeMap<u32, Known> = grammar::INSTRUCTION_TABLE
        .iter()
        .map(|one| {
            let capabilities = one.capabilities.iter().map(|one| *one as u32).collect();
            (one.opcode as u32, (capabilities, one.extensions.iter().map(|one| (*one).to_owned()).collect()))
        })
        .collect();
    text += "\n/// Instructions that rspirv does not know, or with other requirements.\n\
             pub(super) const OPCODES: &[Entry] = &[\n";
    for entry in opcodes.iter().filter(|entry| !entry.is_known(known.get(&entry.number))) {
        text += &entry.row();
    }
    text += "];\n\n/// The first minor version of instructions, where it is neither 1.0 nor that of an extension alone.\n\
             pub(super) const OPCODES_SINCE: &[(u8, &[u32])] = &[\n";
    let all: Vec<&Entry> = opcodes.iter().collect();
    for (version, numbers) in versions(&all, Entry::exceptional_version) {
        let _ = writeln!(text, "    ({version}, &{numbers:?}),");
    }
    text += "];\n\n/// The last minor version of instructions that a later one lacks.\n\
             pub(super) const OPCODES_UNTIL: &[(u8, &[u32])] = &[\n";
    for (version, numbers) in versions(&all, |entry| entry.until) {
        let _ = writeln!(text, "    ({version}, &{numbers:?}),");
    }
    text += "];\n";

    let mut lacking = String::new();
    let mut since = String::new();
    let mut until = String::new();
    for kind in kinds {
        let name = kind["kind"].as_str().expect("a name");
        let Some(known) = rspirv_enumerants(name) else { continue };
        let mut entries = entries(&kind["enumerants"], "enumerant", "value", &capabilities);
        // No bit of a mask asks for nothing.
        entries.retain(|entry| kind["category"] != "BitEnum" || entry.number != 0);
        let unknown: Vec<&Entry> =
            entries.iter().filter(|one| !one.is_known(known(one.number).as_ref())).collect();
        if !unknown.is_empty() {
            let _ = writeln!(lacking, "    (Kind::{name}, &[");
            for entry in unknown {
                lacking += &entry.row();
            }
            lacking += "    ]),\n";
        }
        let all: Vec<&Entry> = entries.iter().collect();
        for (version, numbers) in versions(&all, Entry::exceptional_version) {
            let _ = writeln!(since, "    (Kind::{name}, {version}, &{numbers:?}),");
        }
        for (version, numbers) in versions(&all, |entry| entry.until) {
            let _ = writeln!(until, "    (Kind::{name}, {version}, &{numbers:?}),");
        }
    }
    text += "\n/// Enumerants that rspirv does not know, or with other requirements.\n\
             pub(super) const ENUMERANTS: &[(Kind, &[Entry])] = &[\n";
    text += &lacking;
    text += "];\n\n/// The first minor version of enumerants, where it is neither 1.0 nor that of an extension alone.\n\
             pub(super) const ENUMERANTS_SINCE: &[(Kind, u8, &[u32])] = &[\n";
    text += &since;
    text += "];\n\n/// The last minor version of enumerants that a later one lacks.\n\
             pub(super) const ENUMERANTS_UNTIL: &[(Kind, u8, &[u32])] = &[\n";
    text += &until;
    text += "];\n";

    let in_vulkan: Vec<u32> = vulkan
        .split("<spirvcapability name=\"")
        .skip(1)
        .filter_map(|rest| capabilities.get(rest.split('"').next()?).copied())
        .collect();
    let all = entries(enumerants("Capability"), "enumerant", "value", &capabilities);
    let outside = all.iter().filter(|one| one.since.is_some() && !in_vulkan.contains(&one.number));
    let outside: Vec<u32> = outside.map(|one| one.number).collect();
    let _ = write!(
        text,
        "\n/// Capabilities of SPIR-V itself that no feature, extension or version of Vulkan enables.\n\
         pub(super) const NOT_IN_VULKAN: &[u32] = &{outside:?};\n"
    );
    text
}

/// What rspirv knows of the enumerants of a kind; `None` of kinds without enumerants or that it
/// does not know.
fn rspirv_enumerants(kind: &str) -> Option<fn(u32) -> Option<Known>> {
    fn known(operand: &dr::Operand) -> Known {
        let capabilities = operand.required_capabilities().into_iter().map(|one| one as u32).collect();
        (capabilities, operand.required_extensions().into_iter().map(str::to_owned).collect())
    }
    macro_rules! look_up {
        ($reader:ident: $($name:ident)*) => {
            match kind {
                $(stringify!($name) => {
                    return Some(|number| {
                        spirv::$name::$reader(number).map(|one| known(&dr::Operand::$name(one)))
                    });
                })*
                _ => {}
            }
        };
    }
    look_up! { from_bits:
        ImageOperands FPFastMathMode SelectionControl LoopControl FunctionControl MemorySemantics MemoryAccess
        KernelProfilingInfo RayFlags FragmentShadingRate RawAccessChainOperands CooperativeMatrixOperands
        CooperativeMatrixReduce TensorAddressingOperands MatrixMultiplyAccumulateOperands TensorOperands
    }
    look_up! { from_u32:
        SourceLanguage ExecutionModel AddressingModel MemoryModel ExecutionMode StorageClass Dim
        SamplerAddressingMode SamplerFilterMode ImageFormat ImageChannelOrder ImageChannelDataType FPRoundingMode
        FPDenormMode QuantizationModes FPOperationMode OverflowModes LinkageType AccessQualifier
        HostAccessQualifier FunctionParameterAttribute Decoration BuiltIn Scope GroupOperation KernelEnqueueFlags
        Capability RayQueryIntersection RayQueryCommittedIntersectionType RayQueryCandidateIntersectionType
        PackedVectorFormat CooperativeMatrixLayout CooperativeMatrixUse TensorClampMode
        InitializationModeQualifier LoadCacheControl StoreCacheControl NamedMaximumNumberOfRegisters FPEncoding
        CooperativeVectorMatrixLayout ComponentType
    }
    None
}
