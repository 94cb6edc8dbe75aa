//! Smoke tests of every fixture, and of modules whose inputs are hard to make up.

use std::collections::HashSet;
use std::sync::{Arc, LazyLock, OnceLock};

use anyhit_cases::smoke::{BlockCoverage, EntryReport, SmokeOptions, SmokeReport, SmokeVerdict};
use anyhit_engine::machine::LaunchLimits;
use anyhit_engine::module;
use anyhit_engine::module::Opcode;

use crate::support::{assembly, files};

fn run(bytes: &[u8]) -> SmokeReport {
    let module = Arc::new(module::load(bytes).expect("a module"));
    SmokeReport::of(&module, SmokeOptions::default())
}

/// Every entry point ends in `ok` or in a trap that names its rule and place; what is meant to pass
/// mostly does, although smoke makes up its inputs.
#[test]
fn every_fixture_runs_or_says_why_not() {
    let (mut ok, mut trapped, mut mistakes) = (0, 0, Vec::new());
    for fixture in &*FIXTURES {
        let (name, report) = (&fixture.name, fixture.report());
        for entry in &report.entry_points {
            let traps: Vec<_> = entry.runs.iter().filter_map(|run| run.trap.as_ref()).collect();
            let explained = traps.iter().all(|trap| !trap.rule.is_empty() && trap.word > 0);
            match entry.result {
                SmokeVerdict::Ok => ok += 1,
                SmokeVerdict::Trap if explained && !traps.is_empty() => {
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
    let json = |report: &SmokeReport| serde_json::to_string(report).expect("JSON");
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

/// A buffer of objects, each with two addresses as 64-bit integers and a count of 64 bits:
/// vertices, whose own material is behind a pointer, and indices behind a pair of 32-bit integers.
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

/// Two structures by address, from one buffer: both numbers are the address of the one structure
/// that there is.
#[test]
fn two_addresses_of_structures_lead_to_one() {
    const TYPES: &str = "
    %uvec2 = OpTypeVector %uint 2";
    let address = |first: &str, second: &str, name: &str| {
        format!(
            "
    %a{name} = OpAccessChain %uint_pointer %numbers %0 {first}
    %b{name} = OpLoad %uint %a{name}
    %c{name} = OpAccessChain %uint_pointer %numbers %0 {second}
    %d{name} = OpLoad %uint %c{name}
    %e{name} = OpCompositeConstruct %uvec2 %b{name} %d{name}
    %f{name} = OpConvertUToAccelerationStructureKHR %acceleration %e{name}
    OpTraceNV %f{name} %0 %100 %0 %0 %0 %up %zero %up %one %0
"
        )
    };
    let body = address("%0", "%1", "_first") + &address("%100", "%77", "_second");
    let report = run(&ray_generation(TYPES, &body));
    assert!(report.is_ok(), "{}", report.text());
}

/// What is said of the first values, with which the module traps; with others it does not.
fn told(bytes: &[u8]) -> String {
    let report = run(bytes);
    let note = report.entry_points[0].runs.first().and_then(|run| run.note.clone());
    note.unwrap_or_else(|| panic!("no trap: {}", report.text()))
}

/// A module of `spirv-fixtures`: its path there, and its words.
struct Fixture {
    name: String,
    words: Vec<u32>,
    report: OnceLock<SmokeReport>,
}

impl Fixture {
    /// The report of the module as it is, which several tests look at.
    fn report(&self) -> &SmokeReport {
        self.report.get_or_init(|| run_words(&self.words))
    }
}

/// The modules of `spirv-fixtures`, each once.
static FIXTURES: LazyLock<Vec<Fixture>> = LazyLock::new(|| {
    let root = files::root().join("spirv-fixtures");
    let mut all: Vec<Fixture> = Vec::new();
    let mut known = HashSet::new();
    for path in files::with_extension(&root, "spv") {
        let name = path.strip_prefix(&root).expect("a path below").to_string_lossy().replace('\\', "/");
        let words: Vec<u32> =
            bytemuck::pod_collect_to_vec(&std::fs::read(&path).expect("a readable fixture"));
        if known.insert(words.clone()) {
            all.push(Fixture { name, words, report: OnceLock::new() });
        }
    }
    all
});

/// The instructions of a module.
fn instructions(words: &[u32]) -> impl Iterator<Item = &[u32]> {
    let mut rest = &words[5..];
    std::iter::from_fn(move || {
        let (one, behind) = rest.split_at_checked((rest.first()? >> 16) as usize)?;
        rest = behind;
        Some(one)
    })
}

fn opcode(instruction: &[u32]) -> Opcode {
    Opcode::of_word(instruction[0])
}

fn run_words(words: &[u32]) -> SmokeReport {
    run(&words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>())
}

/// Where t_min and t_max stand in an instruction, in words.
fn interval(instruction: &[u32]) -> Option<[usize; 2]> {
    match opcode(instruction) {
        Opcode::TraceRayKHR | Opcode::TraceNV | Opcode::TraceRayMotionNV | Opcode::TraceMotionNV => {
            Some([8, 10])
        }
        Opcode::RayQueryInitializeKHR => Some([6, 8]),
        Opcode::HitObjectTraceRayNV
        | Opcode::HitObjectTraceRayMotionNV
        | Opcode::HitObjectTraceRayEXT
        | Opcode::HitObjectTraceRayMotionEXT
        | Opcode::HitObjectTraceReorderExecuteEXT
        | Opcode::HitObjectTraceMotionReorderExecuteEXT => Some([9, 11]),
        _ => None,
    }
}

fn coverage(entry: &EntryReport) -> &BlockCoverage {
    entry.coverage.as_ref().expect("an entry point that runs")
}

/// A mutation that every trace must show: t_min and t_max swapped in all traces and ray queries of
/// what is ok as it is. The entry point traps (`SPV_KHR_ray_tracing`: t_min is at most t_max), or
/// its report says that it traced nothing.
#[test]
fn rays_that_end_before_they_begin_trap_or_are_not_reached() {
    let (mut trapped, mut unreached, mut either, mut mistakes) = (0, Vec::new(), Vec::new(), Vec::new());
    // Both ends are made up: as it is, the shader breaks the rule as often.
    let breaks_it = |entry: &EntryReport| {
        let mut notes = entry.runs.iter().filter_map(|run| run.note.as_ref());
        notes.any(|note| note.contains("t_min is above t_max"))
    };
    for fixture in &*FIXTURES {
        let (name, words) = (&fixture.name, &fixture.words);
        if !instructions(words).any(|one| interval(one).is_some()) {
            continue;
        }
        let before = fixture.report();
        let mut mutant = words[..5].to_vec();
        for instruction in instructions(words) {
            let start = mutant.len();
            mutant.extend(instruction);
            if let Some([t_min, t_max]) = interval(instruction) {
                mutant.swap(start + t_min, start + t_max);
            }
        }
        let after = run_words(&mutant);
        for (before, after) in before.entry_points.iter().zip(&after.entry_points) {
            if before.result != SmokeVerdict::Ok {
                continue;
            }
            let reached = coverage(after);
            let executed = reached.trace_instructions_reached + reached.query_instructions_reached;
            match after.result {
                _ if reached.trace_instructions + reached.query_instructions == 0 => {}
                SmokeVerdict::Trap => trapped += 1,
                SmokeVerdict::Ok if executed == 0 => unreached.push(name.clone()),
                SmokeVerdict::Ok if breaks_it(before) && breaks_it(after) => either.push(name.clone()),
                _ => mistakes.push(format!("{name}: {}", run_words(&mutant).text())),
            }
        }
    }
    assert!(mistakes.is_empty(), "{trapped} trap; these do not:\n{}", mistakes.join("\n"));
    assert!(trapped >= TRAPPING, "only {trapped} trap; not reached: {unreached:?}");
    assert_eq!((unreached.len(), either.len()), (UNREACHED, 1), "{unreached:?} {either:?}");
}

/// Entry points of the fixtures with rays that are ok, and trap when rays end before they begin.
/// More fixtures may raise these counts.
const TRAPPING: usize = 103;
/// Those that trace nothing.
const UNREACHED: usize = 0;

/// What must not change with what means nothing to the machine.
fn essence(report: &SmokeReport) -> Vec<String> {
    let entry = |entry: &EntryReport| {
        let runs = entry
            .runs
            .iter()
            .map(|run| (run.with, run.result, run.trap.as_ref().map(|trap| trap.rule.clone())));
        let reached =
            entry.coverage.clone().map(|reached| BlockCoverage { blocks_not_entered: Vec::new(), ..reached });
        format!("{} {:?} {reached:?} {:?}", entry.name, entry.result, runs.collect::<Vec<_>>())
    };
    report.entry_points.iter().map(entry).collect()
}

/// Names, lines and debug information are taken out; then decorations and variables stand the other
/// way round.
#[test]
fn debug_information_and_the_order_of_declarations_change_nothing() {
    let mut compared = 0;
    for fixture in &*FIXTURES {
        let (name, words) = (&fixture.name, &fixture.words);
        let debug: Vec<u32> = instructions(words)
            .filter(|one| opcode(one) == Opcode::ExtInstImport)
            .filter(|one| {
                let name: Vec<u8> = one[2..].iter().flat_map(|word| word.to_le_bytes()).collect();
                name.windows(9).any(|window| window == b"DebugInfo")
            })
            .map(|one| one[1])
            .collect();
        let keeps = |one: &&[u32]| match opcode(one) {
            Opcode::Source | Opcode::SourceContinued | Opcode::SourceExtension | Opcode::ModuleProcessed => {
                false
            }
            Opcode::Name | Opcode::MemberName | Opcode::Line | Opcode::NoLine => false,
            Opcode::ExtInstImport => !debug.contains(&one[1]),
            Opcode::ExtInst | Opcode::ExtInstWithForwardRefsKHR => !debug.contains(&one[3]),
            _ => true,
        };
        let kept: Vec<&[u32]> = instructions(words).filter(keeps).collect();
        let assemble = |kept: &[&[u32]]| [&words[..5], &kept.concat()].concat();
        let is_decoration = |one: &&[u32]| matches!(opcode(one), Opcode::Decorate | Opcode::MemberDecorate);
        let first = kept.iter().position(|one| opcode(one) == Opcode::Function).unwrap_or(kept.len());
        let is_variable = |one: &&[u32]| opcode(one) == Opcode::Variable;
        let mut reordered: Vec<&[u32]> = Vec::new();
        let head = &kept[..first];
        let mut decorations: Vec<&[u32]> = head.iter().copied().filter(is_decoration).collect();
        for one in head {
            match one {
                one if is_decoration(one) => reordered.extend(decorations.pop()),
                one if is_variable(one) => {}
                one => reordered.push(one),
            }
        }
        reordered.extend(head.iter().copied().filter(is_variable).rev());
        reordered.extend(&kept[first..]);
        // A variable that another one is initialised with stands before it.
        let is_ordered = head.iter().any(|one| is_variable(one) && one.len() > 4);
        let changed = assemble(if is_ordered { &kept } else { &reordered });
        assert_eq!(essence(fixture.report()), essence(&run_words(&changed)), "{name}");
        compared += usize::from(!is_ordered);
    }
    assert!(compared > 100, "only {compared} modules");
}

/// A ray generation shader around a body, with a structure, a buffer of numbers and a payload.
fn ray_generation(declarations: &str, body: &str) -> Vec<u8> {
    assembly::assemble(&format!(
        "
    OpCapability RayTracingKHR
    OpExtension \"SPV_KHR_ray_tracing\"
    OpMemoryModel Logical GLSL450
    OpEntryPoint RayGenerationKHR %main \"main\" %structure %numbers
    OpDecorate %structure DescriptorSet 0
    OpDecorate %structure Binding 0
    OpDecorate %numbers DescriptorSet 0
    OpDecorate %numbers Binding 1
    OpDecorate %Numbers Block
    OpMemberDecorate %Numbers 0 Offset 0
    OpDecorate %array ArrayStride 4
    OpDecorate %choice SpecId 7
    %void = OpTypeVoid
    %function = OpTypeFunction %void
    %bool = OpTypeBool
    %uint = OpTypeInt 32 0
    %float = OpTypeFloat 32
    %vec3 = OpTypeVector %float 3
    %0 = OpConstant %uint 0
    %1 = OpConstant %uint 1
    %77 = OpConstant %uint 77
    %100 = OpConstant %uint 100
    %5000 = OpConstant %uint 5000
    %zero = OpConstant %float 0
    %one = OpConstant %float 1
    %up = OpConstantComposite %vec3 %zero %one %zero
    %choice = OpSpecConstantFalse %bool
    %acceleration = OpTypeAccelerationStructureKHR
    %structure_pointer = OpTypePointer UniformConstant %acceleration
    %structure = OpVariable %structure_pointer UniformConstant
    %array = OpTypeRuntimeArray %uint
    %Numbers = OpTypeStruct %array
    %Numbers_pointer = OpTypePointer StorageBuffer %Numbers
    %numbers = OpVariable %Numbers_pointer StorageBuffer
    %uint_pointer = OpTypePointer StorageBuffer %uint
    {declarations}
    %main = OpFunction %void None %function
    %begin = OpLabel
    {body}
    OpReturn
    OpFunctionEnd
    "
    ))
}

/// A trace whose t_min is 1 and t_max 0, by NV's instruction: its payload's variable is not there.
const BACKWARDS: &str = "
    %s = OpLoad %acceleration %structure
    OpTraceNV %s %0 %100 %0 %0 %0 %up %one %up %zero %0
";
const FORWARDS: &str = "
    %s = OpLoad %acceleration %structure
    OpTraceNV %s %0 %100 %0 %0 %0 %up %zero %up %one %0
";

fn guarded(condition: &str, body: &str) -> String {
    format!(
        "
    {condition}
    OpSelectionMerge %behind None
    OpBranchConditional %holds %then %behind
    %then = OpLabel
    {body}
    OpBranch %behind
    %behind = OpLabel
    "
    )
}

/// The number at an index of the buffer, compared.
fn number(index: &str, comparison: &str) -> String {
    format!(
        "%p = OpAccessChain %uint_pointer %numbers %0 {index}
         %n = OpLoad %uint %p
         %holds = {comparison}"
    )
}

#[test]
fn an_optimised_away_payload_is_no_obstacle() {
    let report = run(&ray_generation("", FORWARDS));
    assert!(report.is_ok(), "{}", report.text());
    // It does not ask where it stands in the launch: one invocation is all that there is to see.
    assert_eq!(coverage(&report.entry_points[0]).rays_traced, 1);
    let report = run(&ray_generation("", BACKWARDS));
    assert_eq!(report.entry_points[0].result, SmokeVerdict::Trap, "{}", report.text());
}

/// No number is 77: the trace is never reached, and the report says so.
#[test]
fn what_is_not_reached_is_told() {
    let report = run(&ray_generation("", &guarded(&number("%0", "OpIEqual %bool %n %77"), BACKWARDS)));
    let reached = coverage(&report.entry_points[0]);
    assert_eq!((reached.blocks_entered, reached.blocks), (2, 3));
    assert_eq!((reached.trace_instructions_reached, reached.trace_instructions), (0, 1));
    assert_eq!((reached.rays_traced, reached.cut_short), (0, None));
    assert!(reached.sets > 10, "{reached:?}");
    let text = report.text();
    assert!(text.starts_with("RayGenerationKHR `main`: ok, reached 2 of 3 blocks\n"), "{text}");
    assert!(text.contains("0 rays traced by 0 of 1 trace"), "{text}");
}

/// A number above 100, a 0, a 1, zeros as floats and another value of a specialization constant are
/// all found, and so is the trap behind them; no value of the shader's own is made up there, so
/// that all sets that come there trap.
#[test]
fn values_of_every_kind_are_tried() {
    let float = "%p = OpAccessChain %uint_pointer %numbers %0 %0
         %n = OpLoad %uint %p
         %holds = OpIEqual %bool %n %0";
    for condition in [
        number("%0", "OpUGreaterThan %bool %n %100"),
        number("%0", "OpIEqual %bool %n %1"),
        float.to_owned(),
        "%holds = OpCopyObject %bool %choice".to_owned(),
    ] {
        let report = run(&ray_generation("", &guarded(&condition, BACKWARDS)));
        let entry = &report.entry_points[0];
        assert_eq!(entry.result, SmokeVerdict::Trap, "{condition}: {}", report.text());
        let trap = entry.runs[0].trap.as_ref().expect("a trap");
        let note = trap.error.notes.last().expect("a note");
        assert!(
            note.starts_with("on synthetic inputs; ") && note.contains(", 0 passed this instruction"),
            "{note}"
        );
        let report = run(&ray_generation("", &guarded(&condition, FORWARDS)));
        let reached = coverage(&report.entry_points[0]);
        assert!(
            report.is_ok() && reached.blocks_entered == 3 && reached.rays_traced > 0,
            "{}",
            report.text()
        );
        assert!(report.text().starts_with("RayGenerationKHR `main`: ok\n"), "{}", report.text());
    }
}

/// The buffer has 1024 numbers at first.
#[test]
fn what_is_too_small_is_made_larger() {
    let report = run(&ray_generation("", &guarded(&number("%5000", "OpIEqual %bool %n %0"), FORWARDS)));
    let note = report.entry_points[0].runs[0].note.clone().unwrap_or_else(|| panic!("{}", report.text()));
    assert!(report.is_ok() && note.contains("runs with larger resources"), "{note}");
}

#[test]
fn fuel_ends_the_search_and_says_so() {
    let bytes = ray_generation("", &guarded(&number("%0", "OpIEqual %bool %n %77"), BACKWARDS));
    let module = Arc::new(module::load(&bytes).expect("a module"));
    let of = |options: SmokeOptions| {
        let report = SmokeReport::of(&module, options);
        let reached = coverage(&report.entry_points[0]);
        (reached.sets, reached.cut_short)
    };
    let little = SmokeOptions::default().total_fuel(1);
    assert_eq!(of(little), (1, Some("fuel")));
    let no_time = SmokeOptions::default().time_limit(std::time::Duration::ZERO);
    assert_eq!(of(no_time), (1, Some("time")));
}

/// Fuel for years: the clock alone ends the loop, and no other values are tried.
#[test]
fn the_clock_ends_the_search_and_says_so() {
    let endless = "OpBranch %head
         %head = OpLabel
         OpLoopMerge %end %continue None
         OpBranch %continue
         %continue = OpLabel
         OpBranch %head
         %end = OpLabel";
    let module = Arc::new(module::load(&ray_generation("", endless)).expect("a module"));
    let time = std::time::Duration::from_millis(20);
    for launch_limits in [LaunchLimits::default().batch_timeout(time), LaunchLimits::default().timeout(time)]
    {
        let options = SmokeOptions::default().fuel(1 << 60).total_fuel(u64::MAX).launch_limits(launch_limits);
        let report = SmokeReport::of(&module, options);
        let reached = coverage(&report.entry_points[0]);
        assert_eq!((reached.sets, reached.cut_short), (1, Some("time")), "{}", report.text());
        assert_eq!(report.entry_points[0].result, SmokeVerdict::Trap, "{}", report.text());
    }
}

/// What lies behind pointers takes time to make, as buffers do: 64 MiB are 32 MiB more than are
/// free, which count as four million operations.
#[test]
fn memory_behind_pointers_costs_fuel() {
    let of = |elements: u32| {
        let bytes = assembly::assemble(&format!(
            "
    OpCapability Shader
    OpCapability Int64
    OpCapability PhysicalStorageBufferAddresses
    OpExtension \"SPV_KHR_physical_storage_buffer\"
    OpMemoryModel PhysicalStorageBuffer64 GLSL450
    OpEntryPoint GLCompute %main \"main\" %links
    OpExecutionMode %main LocalSize 1 1 1
    OpDecorate %links DescriptorSet 0
    OpDecorate %links Binding 0
    OpDecorate %Links Block
    OpMemberDecorate %Links 0 Offset 0
    OpMemberDecorate %Links 1 Offset 8
    OpDecorate %Large Block
    OpMemberDecorate %Large 0 Offset 0
    OpDecorate %array ArrayStride 4
    %void = OpTypeVoid
    %function = OpTypeFunction %void
    %bool = OpTypeBool
    %uint = OpTypeInt 32 0
    %0 = OpConstant %uint 0
    %1 = OpConstant %uint 1
    %77 = OpConstant %uint 77
    %elements = OpConstant %uint {elements}
    %array = OpTypeArray %uint %elements
    %Large = OpTypeStruct %array
    %Large_pointer = OpTypePointer PhysicalStorageBuffer %Large
    %Links = OpTypeStruct %Large_pointer %uint
    %Links_pointer = OpTypePointer StorageBuffer %Links
    %links = OpVariable %Links_pointer StorageBuffer
    %uint_pointer = OpTypePointer StorageBuffer %uint
    %main = OpFunction %void None %function
    %begin = OpLabel
    %p = OpAccessChain %uint_pointer %links %1
    %n = OpLoad %uint %p
    %holds = OpIEqual %bool %n %77
    OpSelectionMerge %end None
    OpBranchConditional %holds %then %end
    %then = OpLabel
    OpBranch %end
    %end = OpLabel
    OpReturn
    OpFunctionEnd
    "
        ));
        let module = Arc::new(module::load(&bytes).expect("a module"));
        let report = SmokeReport::of(&module, SmokeOptions::default().total_fuel(1 << 22));
        let reached = coverage(&report.entry_points[0]);
        (reached.sets, reached.cut_short)
    };
    assert_eq!(of(1 << 24), (1, Some("fuel")));
    let (sets, cut_short) = of(1 << 10);
    assert!(sets > 10 && cut_short.is_none(), "{sets} {cut_short:?}");
}

/// Hit kinds of triangles are 254 and 255: what another kind of geometry does is no fault of a
/// shader for triangles. Each trap is told once.
#[test]
fn a_kind_of_geometry_that_passes_makes_the_others_notes() {
    let shader = |base: &str| {
        assembly::assemble(&format!(
            "
    OpCapability RayTracingKHR
    OpExtension \"SPV_KHR_ray_tracing\"
    OpMemoryModel Logical GLSL450
    OpEntryPoint ClosestHitKHR %main \"main\" %kind %payload %table
    OpDecorate %kind BuiltIn HitKindKHR
    %void = OpTypeVoid
    %function = OpTypeFunction %void
    %uint = OpTypeInt 32 0
    %2 = OpConstant %uint 2
    %base = OpConstant %uint {base}
    %array = OpTypeArray %uint %2
    %input = OpTypePointer Input %uint
    %kind = OpVariable %input Input
    %incoming = OpTypePointer IncomingRayPayloadKHR %uint
    %payload = OpVariable %incoming IncomingRayPayloadKHR
    %private = OpTypePointer Private %array
    %table = OpVariable %private Private
    %element = OpTypePointer Private %uint
    %main = OpFunction %void None %function
    %begin = OpLabel
    %a = OpLoad %uint %kind
    %b = OpISub %uint %a %base
    %c = OpAccessChain %element %table %b
    %d = OpLoad %uint %c
    OpStore %payload %d
    OpReturn
    OpFunctionEnd
    "
        ))
    };
    let report = run(&shader("254"));
    assert!(report.is_ok(), "{}", report.text());
    let entry = &report.entry_points[0];
    let results: Vec<_> = entry.runs.iter().map(|run| (run.with, run.result, run.is_note())).collect();
    assert_eq!(results[0], ("triangle", SmokeVerdict::Ok, false));
    assert_eq!(results[1], ("aabb", SmokeVerdict::Trap, true));
    // No hit kind is 1000 or 1001.
    let report = run(&shader("1000"));
    assert_eq!(report.entry_points[0].result, SmokeVerdict::Trap);
    assert_eq!(report.text().matches(RULE).count(), 1, "{}", report.text());
    assert!(report.text().contains("triangle, aabb, sphere, lss: trap"), "{}", report.text());
}

/// Each invocation stores to a texel of its own: 32 x 32 of them.
#[test]
fn images_are_as_large_as_the_dispatch() {
    let shader = |dimension: &str, multisampled: u32| {
        assembly::assemble(
            &format!(
                "
    OpCapability Shader
    OpCapability StorageImageMultisample
    OpCapability ImageQuery
    OpMemoryModel Logical GLSL450
    OpEntryPoint GLCompute %main \"main\" %id %image
    OpExecutionMode %main LocalSize 16 16 1
    OpDecorate %id BuiltIn GlobalInvocationId
    OpDecorate %image DescriptorSet 0
    OpDecorate %image Binding 0
    %void = OpTypeVoid
    %function = OpTypeFunction %void
    %uint = OpTypeInt 32 0
    %float = OpTypeFloat 32
    %uvec3 = OpTypeVector %uint 3
    %uvec2 = OpTypeVector %uint 2
    %vec4 = OpTypeVector %float 4
    %one = OpConstant %float 1
    %0 = OpConstant %uint 0
    %ones = OpConstantComposite %vec4 %one %one %one %one
    %input = OpTypePointer Input %uvec3
    %id = OpVariable %input Input
    %image_type = OpTypeImage %float {dimension} 0 0 {multisampled} 2 Rgba32f
    %pointer = OpTypePointer UniformConstant %image_type
    %image = OpVariable %pointer UniformConstant
    %main = OpFunction %void None %function
    %begin = OpLabel
    %a = OpLoad %uvec3 %id
    %b = OpVectorShuffle %uvec2 %a %a 0 1
    %c = OpLoad %image_type %image
    STORE
    OpReturn
    OpFunctionEnd
    "
            )
            .replace(
                "STORE",
                match (dimension, multisampled) {
                    (_, 0) => "OpImageWrite %c %b %ones",
                    ("2D", _) => "%d = OpImageQuerySize %uvec2 %c",
                    _ => "%d = OpImageQuerySize %uvec3 %c",
                },
            ),
        )
    };
    for multisampled in [0, 1] {
        let report = run(&shader("2D", multisampled));
        assert!(report.is_ok() && report.entry_points[0].runs[0].note.is_none(), "{}", report.text());
    }
    // No image has several samples and three axes: whose fault that is, it is not this program's.
    let report = run(&shader("3D", 1));
    assert_ne!(report.entry_points[0].result, SmokeVerdict::Bug, "{}", report.text());
}

#[test]
fn too_little_coverage_fails_where_it_is_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("part.spv");
    std::fs::write(&path, ray_generation("", &guarded(&number("%0", "OpIEqual %bool %n %77"), BACKWARDS)))
        .expect("a file");
    let ends = |percent: &str| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
        let output = command.arg("smoke").arg(&path).args(["--json", "--min-coverage", percent]).output();
        let output = output.expect("the command");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    // 2 of 3 blocks.
    assert_eq!(ends("66").0, Some(0));
    let (code, told) = ends("67");
    assert!(code == Some(1) && told.contains("RayGenerationKHR `main` reached 2 of 3 blocks"), "{told}");
    assert_eq!(ends("101").0, Some(2));
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

/// Invocations side by side along an axis that the shader does not ask for would all write the same
/// elements.
#[test]
fn a_shader_of_one_axis_is_launched_in_a_row() {
    let path = files::root();
    let path = path.join("spirv-fixtures/sanitize/ho-empty/mended.rgen.spv");
    let module = Arc::new(module::load(&std::fs::read(path).expect("a fixture")).expect("a module"));
    let report = SmokeReport::of(&module, SmokeOptions::default().sanitize());
    let [entry] = &report.entry_points[..] else { panic!("{}", report.text()) };
    let races: Vec<_> = entry.findings.iter().filter(|one| one.rule.id.starts_with("race-")).collect();
    assert!(races.is_empty(), "{races:?}");
}
