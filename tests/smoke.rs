//! Smoke tests of every fixture, and of modules whose inputs are hard to make up.

use std::path::Path;
use std::sync::Arc;

use anyhit::harness::smoke::{self, Options, Report, Verdict};
use anyhit::module;

#[path = "support/assembly.rs"]
mod assembly;
#[path = "support/files.rs"]
mod files;

fn run(bytes: &[u8]) -> Report {
    let module = Arc::new(module::load(bytes).expect("a module"));
    smoke::run(&module, Options::default())
}

/// Every entry point ends in `ok` or in a trap that names its rule and place; what is meant to pass mostly does,
/// although smoke makes up its inputs.
#[test]
fn every_fixture_runs_or_says_why_not() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures");
    let (mut ok, mut trapped, mut mistakes) = (0, 0, Vec::new());
    for path in files::with_extension(&root, "spv") {
        let name = path.strip_prefix(&root).expect("a path below").to_string_lossy().replace('\\', "/");
        let report = run(&std::fs::read(&path).expect("a readable fixture"));
        for entry in &report.entry_points {
            let traps: Vec<_> = entry.runs.iter().filter_map(|run| run.trap.as_ref()).collect();
            let explained = traps.iter().all(|trap| !trap.rule.is_empty() && trap.word > 0);
            match entry.result {
                Verdict::Ok => ok += 1,
                Verdict::Trap if explained && !traps.is_empty() => {
                    trapped += usize::from(name.starts_with("pass/"))
                }
                _ => mistakes.push(format!("{name}:\n{}", report.text())),
            }
        }
    }
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
    assert!(ok > 100 && trapped * 10 < ok, "{ok} ok, {trapped} trapped");
}

/// Its rays are wrong on purpose.
#[test]
fn a_broken_rule_is_told() {
    let report =
        run(&std::fs::read("spirv-fixtures/fail/trace/invalid-ray/main.rgen.spv").expect("a fixture"));
    let trap = report.entry_points[0].runs[0].trap.as_ref().expect("a trap");
    assert!(trap.rule.contains("a trace break a rule"), "{}", trap.rule);
}

#[test]
fn a_report_is_the_same_every_time() {
    let bytes = std::fs::read("spirv-fixtures/fail/trace/invalid-ray/main.rgen.spv").expect("a fixture");
    let json = |report: &Report| serde_json::to_string(report).expect("JSON");
    assert_eq!(json(&run(&bytes)), json(&run(&bytes)));
    let parsed: serde_json::Value = serde_json::from_str(&json(&run(&bytes))).expect("JSON");
    let entry = &parsed["entry_points"][0];
    assert_eq!((&entry["stage"], &entry["result"]), (&"RayGenerationKHR".into(), &"trap".into()));
    assert_eq!((&entry["runs"][0]["with"], &entry["reasons"]), (&"launch".into(), &serde_json::json!([])));
    let trap = &entry["runs"][0]["trap"];
    // The trap's line stands in the source: the trace.
    assert_eq!(
        (&trap["file"], &trap["line"]),
        (&"shaders/fail/trace/invalid-ray/main.rgen".into(), &20.into())
    );
}

/// A buffer of objects, each with two addresses as 64-bit integers and a count of 64 bits: vertices,
/// whose own material is behind a pointer, and indices behind a pair of 32-bit integers.
const OBJECTS: &str = "
    OpCapability RayTracingKHR
    OpCapability Int64
    OpCapability PhysicalStorageBufferAddresses
    OpExtension \"SPV_KHR_ray_tracing\"
    OpExtension \"SPV_KHR_physical_storage_buffer\"
    OpMemoryModel PhysicalStorageBuffer64 GLSL450
    OpEntryPoint ClosestHitKHR %main \"main\" %objects %payload
    OpDecorate %objects DescriptorSet 0
    OpDecorate %objects Binding 0
    OpDecorate %Objects Block
    OpMemberDecorate %Objects 0 Offset 0
    OpDecorate %object_array ArrayStride 24
    OpMemberDecorate %Object 0 Offset 0
    OpMemberDecorate %Object 1 Offset 8
    OpMemberDecorate %Object 2 Offset 16
    OpDecorate %vertex_array ArrayStride 16
    OpDecorate %Vertices Block
    OpMemberDecorate %Vertices 0 Offset 0
    OpMemberDecorate %Vertex 0 Offset 0
    OpMemberDecorate %Vertex 1 Offset 8
    OpMemberDecorate %Material 0 Offset 0
    OpDecorate %Material Block
    OpDecorate %index_array ArrayStride 4
    OpDecorate %Indices Block
    OpMemberDecorate %Indices 0 Offset 0
    OpDecorate %vertices AliasedPointer
    OpDecorate %indices AliasedPointer
    %void = OpTypeVoid
    %function = OpTypeFunction %void
    %bool = OpTypeBool
    %uint = OpTypeInt 32 0
    %ulong = OpTypeInt 64 0
    %float = OpTypeFloat 32
    %uvec2 = OpTypeVector %uint 2
    %0 = OpConstant %uint 0
    %1 = OpConstant %uint 1
    %2 = OpConstant %uint 2
    %none = OpConstant %ulong 0 0
    %one = OpConstant %ulong 1 0
    %Object = OpTypeStruct %ulong %uvec2 %ulong
    %object_array = OpTypeRuntimeArray %Object
    %Objects = OpTypeStruct %object_array
    %Objects_pointer = OpTypePointer StorageBuffer %Objects
    %objects = OpVariable %Objects_pointer StorageBuffer
    %payload_pointer = OpTypePointer IncomingRayPayloadKHR %float
    %payload = OpVariable %payload_pointer IncomingRayPayloadKHR
    %Material = OpTypeStruct %float
    %Material_pointer = OpTypePointer PhysicalStorageBuffer %Material
    %Vertex = OpTypeStruct %float %Material_pointer
    %vertex_array = OpTypeRuntimeArray %Vertex
    %Vertices = OpTypeStruct %vertex_array
    %Vertices_pointer = OpTypePointer PhysicalStorageBuffer %Vertices
    %index_array = OpTypeRuntimeArray %uint
    %Indices = OpTypeStruct %index_array
    %Indices_pointer = OpTypePointer PhysicalStorageBuffer %Indices
    %uint_pointer = OpTypePointer PhysicalStorageBuffer %uint
    %float_pointer = OpTypePointer PhysicalStorageBuffer %float
    %Material_pointer_pointer = OpTypePointer PhysicalStorageBuffer %Material_pointer
    %ulong_pointer = OpTypePointer StorageBuffer %ulong
    %uvec2_pointer = OpTypePointer StorageBuffer %uvec2
    %main = OpFunction %void None %function
    %begin = OpLabel
    %a = OpAccessChain %ulong_pointer %objects %0 %1 %0
    %b = OpLoad %ulong %a
    %vertices = OpConvertUToPtr %Vertices_pointer %b
    %c = OpAccessChain %uvec2_pointer %objects %0 %1 %1
    %d = OpLoad %uvec2 %c
    %indices = OpBitcast %Indices_pointer %d
    %e = OpAccessChain %uint_pointer %indices %0 %2
    %index = OpLoad %uint %e Aligned 4
    %f = OpAccessChain %Material_pointer_pointer %vertices %0 %index %1
    %material = OpLoad %Material_pointer %f Aligned 8
    %g = OpAccessChain %float_pointer %material %0
    %h = OpLoad %float %g Aligned 4
    OpStore %payload %h
    %i = OpAccessChain %ulong_pointer %objects %0 %1 %2
    %count = OpLoad %ulong %i
    OpBranch %loop
    %loop = OpLabel
    %k = OpPhi %ulong %none %begin %next %body
    %more = OpULessThan %bool %k %count
    OpLoopMerge %end %body None
    OpBranchConditional %more %body %end
    %body = OpLabel
    %next = OpIAdd %ulong %k %one
    OpBranch %loop
    %end = OpLabel
    OpReturn
    OpFunctionEnd
";

#[test]
fn numbers_become_addresses_where_memory_is_reached_through_them() {
    let report = run(&assembly::assemble(OBJECTS));
    assert!(report.is_ok(), "{}", report.text());
    let kinds: Vec<_> = report.entry_points[0].runs.iter().map(|run| run.with).collect();
    assert_eq!(kinds, ["triangle", "aabb", "sphere", "lss"]);
    assert!(report.entry_points[0].runs.iter().all(|run| run.note.is_none()), "{}", report.text());
}

/// What is said of the first values, with which the module traps; with others it does not.
fn told(bytes: &[u8]) -> String {
    let report = run(bytes);
    let note = report.entry_points[0].runs.first().and_then(|run| run.note.clone());
    note.unwrap_or_else(|| panic!("no trap: {}", report.text()))
}

const RULE: &str = "an index is outside its array";
const LINE: &str = "shaders/fail/memory/full-debug-info/main.rgen:14";

#[test]
fn debug_information_of_every_revision_is_read() {
    let bytes = std::fs::read("spirv-fixtures/fail/memory/full-debug-info/main.rgen.spv").expect("a fixture");
    const SET: &[u8] = b"NonSemantic.Shader.DebugInfo.10";
    let at = bytes.windows(SET.len()).position(|window| window == SET).expect("the set's name") + SET.len();
    for revision in b"0129" {
        let mut bytes = bytes.clone();
        bytes[at] = *revision;
        let told = told(&bytes);
        assert!(told.contains(RULE) && told.contains(LINE), "revision 10{}: {told}", *revision as char);
    }
    // A set that nobody knows says nothing: the trap has no line.
    let mut unknown = bytes;
    unknown[at - SET.len() + 12] = b'X';
    let told = told(&unknown);
    assert!(told.contains(RULE) && !told.contains(LINE), "{told}");
}

/// What a compiler gets wrong in what only people read must not keep a shader from running.
#[test]
fn broken_debug_information_does_no_harm() {
    let bytes = std::fs::read("spirv-fixtures/fail/memory/full-debug-info/main.rgen.spv").expect("a fixture");
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
    let (mut at, mut tried, mut set) = (5, 0, 0);
    while at < words.len() {
        let (count, opcode) = ((words[at] >> 16) as usize, words[at] & 0xffff);
        // OpExtInstImport: the first set is the debug information's.
        if opcode == 11 && set == 0 {
            set = words[at + 1];
        }
        if opcode == 12 && words[at + 3] == set {
            for operand in at + 4..at + count {
                // The set itself, which is no operand, and a number that no instruction has.
                for other in [set, 0x7fff] {
                    let mut broken = words.clone();
                    broken[operand] = other;
                    let bytes: Vec<u8> = broken.iter().flat_map(|word| word.to_le_bytes()).collect();
                    let told = told(&bytes);
                    assert!(told.contains(RULE), "word {operand}: {other}: {told}");
                    tried += 1;
                }
            }
        }
        at += count;
    }
    assert!(tried > 200, "only {tried} operands");
}
