//! Modules that ask for too much: each limit has a name, and chains as long as a module are
//! followed without the native stack.
//!
//! The modules are generated. Each is loaded and lowered in a thread with a small stack, run, and
//! given to the program itself.

use std::fmt::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::input::{InputLimit, InputLimits};
use anyhit_cases::smoke::{SmokeOptions, SmokeReport, SmokeVerdict};
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::module;
use anyhit_engine::pipeline::{Compute, RunOptions};
use anyhit_engine::program::{LowerOptions, Program, lower_with};

use crate::support::assembly::assemble;

/// The stack of the main thread where it is smallest (Windows).
const SMALL_STACK: usize = 1 << 20;
/// Links of a chain.
const LONG: usize = 10_000;
/// What no hostile module may take, in a debug build on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// A compute shader beside the usual declarations.
#[derive(Default)]
struct Shader {
    /// Further capabilities.
    capabilities: String,
    /// Further decorations.
    annotations: String,
    /// Further types, constants and variables.
    declarations: String,
    /// The body, without its label and return.
    body: String,
    /// Further functions.
    functions: String,
}

impl Shader {
    fn bytes(&self) -> Vec<u8> {
        let Self { capabilities, annotations, declarations, body, functions } = self;
        assemble(&format!(
            "OpCapability Shader
             OpCapability ImageQuery
             OpCapability VariablePointers
             OpCapability RuntimeDescriptorArray
             {capabilities}
             OpMemoryModel Logical GLSL450
             OpEntryPoint GLCompute %main \"main\" %out %id
             OpExecutionMode %main LocalSize 1 1 1
             OpDecorate %Out Block
             OpMemberDecorate %Out 0 Offset 0
             OpDecorate %uints ArrayStride 4
             OpDecorate %out DescriptorSet 0
             OpDecorate %out Binding 0
             OpDecorate %id BuiltIn GlobalInvocationId
             {annotations}
             %void = OpTypeVoid
             %function = OpTypeFunction %void
             %bool = OpTypeBool
             %uint = OpTypeInt 32 0
             %float = OpTypeFloat 32
             %uvec2 = OpTypeVector %uint 2
             %uvec3 = OpTypeVector %uint 3
             %vec4 = OpTypeVector %float 4
             %true = OpConstantTrue %bool
             %u0 = OpConstant %uint 0
             %u1 = OpConstant %uint 1
             %u2 = OpConstant %uint 2
             %uints = OpTypeRuntimeArray %uint
             %Out = OpTypeStruct %uints
             %ptr_Out = OpTypePointer StorageBuffer %Out
             %ptr_uint = OpTypePointer StorageBuffer %uint
             %ptr_uvec3 = OpTypePointer Input %uvec3
             %out = OpVariable %ptr_Out StorageBuffer
             %id = OpVariable %ptr_uvec3 Input
             {declarations}
             %main = OpFunction %void None %function
             %begin = OpLabel
             %first = OpAccessChain %ptr_uint %out %u0 %u0
             {body}
             OpReturn
             OpFunctionEnd
             {functions}"
        ))
    }
}

/// Text of a list of things.
fn lines(range: std::ops::RangeInclusive<usize>, line: impl Fn(usize) -> String) -> String {
    let mut text = String::new();
    for at in range {
        writeln!(text, "{}", line(at)).expect("a string grows");
    }
    text
}

/// Runs work in a thread whose stack is small.
fn small_stack<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let thread = std::thread::Builder::new().stack_size(SMALL_STACK).spawn(work).expect("a thread");
    thread.join().expect("no panic")
}

/// The program of a module's one entry point, loaded and lowered in a small stack.
fn lowered(bytes: &[u8]) -> Result<Program> {
    let bytes = bytes.to_vec();
    small_stack(move || {
        let module = Arc::new(module::load(&bytes)?);
        // The check of the optimizer is no part of the program that users run.
        let options = LowerOptions { verify: false, ..LowerOptions::default() };
        lower_with(&module, &module.entry_points[0], options)
    })
}

/// The first word that a module's compute shader leaves, which runs once.
fn first_word(bytes: &[u8]) -> Result<u32> {
    let program = lowered(bytes)?;
    let out = Buffer::zeroed(64);
    let mut resources = Resources::default();
    resources.descriptors.insert(Binding { set: 0, binding: 0 }, vec![Descriptor::Buffer(out.clone())]);
    Compute::new(Arc::new(program))?.run(&resources, [1, 1, 1], RunOptions::default())?;
    Ok(out.load(0, 32).expect("a word"))
}

/// What the program says of a module: its exit code, what it prints, what it says of errors. It
/// must end by itself, and soon.
fn program(command: &str, name: &str, bytes: &[u8], arguments: &[&str]) -> (i32, String, String) {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("load-limits-{name}.spv"));
    std::fs::write(&path, bytes).expect("a writable folder");
    let begin = Instant::now();
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .arg(command)
        .arg(&path)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .expect("the command starts");
    assert!(begin.elapsed() < PATIENCE, "{command} {name} took {:?}", begin.elapsed());
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    let (out, err) = (text(stdout), text(stderr));
    let code = status.code().unwrap_or_else(|| panic!("{command} {name}: {status}: {err}"));
    assert!(!out.contains("bug in anyhit") && !err.contains("bug in anyhit"), "{out}{err}");
    (code, out, err)
}

/// A chain is followed in a small stack and by the program, and ends in a number.
#[track_caller]
fn follows(name: &str, shader: &Shader, expected: u32) {
    let bytes = shader.bytes();
    let begin = Instant::now();
    assert_eq!(first_word(&bytes).expect("a module that runs"), expected);
    assert!(begin.elapsed() < PATIENCE, "{name} took {:?}", begin.elapsed());
    for command in ["inspect", "smoke"] {
        let (code, out, err) = program(command, name, &bytes, &[]);
        assert_eq!(code, 0, "{command} {name}: {out}{err}");
    }
}

#[test]
fn a_chain_of_specialization_constants() {
    let shader = Shader {
        annotations: "OpDecorate %c0 SpecId 0".into(),
        declarations: "%c0 = OpSpecConstant %uint 7\n".to_owned()
            + &lines(1..=LONG, |at| format!("%c{at} = OpSpecConstantOp %uint IAdd %c{} %u1", at - 1)),
        body: format!("OpStore %first %c{LONG}"),
        ..Shader::default()
    };
    follows("constants", &shader, 7 + LONG as u32);
}

/// The operand that leads on need not be the first, and constants are also made of composites.
#[test]
fn a_chain_of_composites_of_specialization_constants() {
    let link = |at: usize| {
        format!(
            "%e{at} = OpSpecConstantOp %uint CompositeExtract %c{0} 1
             %p{at} = OpSpecConstantOp %uint IAdd %u1 %e{at}
             %c{at} = OpSpecConstantComposite %uvec2 %u0 %p{at}",
            at - 1
        )
    };
    let shader = Shader {
        declarations: "%c0 = OpSpecConstantComposite %uvec2 %u0 %u1\n".to_owned() + &lines(1..=LONG, link),
        body: format!(
            "%last = OpCompositeExtract %uint %c{LONG} 1
             OpStore %first %last"
        ),
        ..Shader::default()
    };
    follows("composites", &shader, 1 + LONG as u32);
}

/// Each length is computed from an array of the length before.
#[test]
fn a_chain_of_array_lengths() {
    let link = |at: usize| {
        format!(
            "%a{at} = OpTypeArray %uint %l{0}
             %n{at} = OpConstantNull %a{at}
             %e{at} = OpSpecConstantOp %uint CompositeExtract %n{at} 0
             %l{at} = OpSpecConstantOp %uint IAdd %e{at} %u1",
            at - 1
        )
    };
    let shader = Shader {
        declarations: "%l0 = OpSpecConstant %uint 1\n".to_owned() + &lines(1..=LONG, link),
        body: format!("OpStore %first %l{LONG}"),
        ..Shader::default()
    };
    follows("lengths", &shader, 1);
}

/// The layout of a vector behind a pointer is looked for where the pointer comes from.
#[test]
fn a_chain_of_pointers() {
    let select = |at: usize| format!("%p{at} = OpSelect %ptr_uvec2 %less %p{0} %p{0}", at - 1);
    let shader = Shader {
        annotations: "OpDecorate %Pairs Block
             OpMemberDecorate %Pairs 0 Offset 0
             OpDecorate %pairs DescriptorSet 0
             OpDecorate %pairs Binding 0
             OpDecorate %pairs Aliased"
            .into(),
        declarations: "%Pairs = OpTypeStruct %uvec2
             %ptr_Pairs = OpTypePointer StorageBuffer %Pairs
             %ptr_uvec2 = OpTypePointer StorageBuffer %uvec2
             %pairs = OpVariable %ptr_Pairs StorageBuffer"
            .into(),
        body: "%i = OpLoad %uvec3 %id
             %x = OpCompositeExtract %uint %i 0
             %less = OpULessThan %bool %x %u1
             OpStore %first %u2
             %a = OpAccessChain %ptr_uvec2 %pairs %u0
             %p0 = OpSelect %ptr_uvec2 %less %a %a\n"
            .to_owned()
            + &lines(1..=LONG, select)
            + &format!(
                "%pair = OpLoad %uvec2 %p{LONG}
                 %word = OpCompositeExtract %uint %pair 0
                 %sum = OpIAdd %uint %word %u1
                 OpStore %first %sum"
            ),
        ..Shader::default()
    };
    follows("pointers", &shader, 3);
}

/// The stride of the array that two pointers lead into is looked for where they come from.
#[test]
fn a_chain_of_pointers_whose_distance_is_taken() {
    let select = |at: usize| format!("%p{at} = OpSelect %ptr_uint %less %p{0} %p{0}", at - 1);
    let shader = Shader {
        body: "%i = OpLoad %uvec3 %id
             %x = OpCompositeExtract %uint %i 0
             %less = OpULessThan %bool %x %u1
             %a = OpAccessChain %ptr_uint %out %u0 %u2
             %p0 = OpSelect %ptr_uint %less %a %a\n"
            .to_owned()
            + &lines(1..=LONG, select)
            + &format!(
                "%distance = OpPtrDiff %uint %p{LONG} %first
                 OpStore %first %distance"
            ),
        ..Shader::default()
    };
    follows("distance", &shader, 2);
}

/// Searches for strides count towards the limit of operations: each is as long as the module.
#[test]
fn many_searches_for_a_stride_are_limited() {
    const LINKS: usize = 2000;
    const SEARCHES: usize = 100;
    let select = |at: usize| format!("%p{at} = OpSelect %ptr_uint %less %p{0} %p{0}", at - 1);
    let shader = Shader {
        body: "%i = OpLoad %uvec3 %id
             %x = OpCompositeExtract %uint %i 0
             %less = OpULessThan %bool %x %u1
             %a = OpAccessChain %ptr_uint %out %u0 %u2
             %p0 = OpSelect %ptr_uint %less %a %a\n"
            .to_owned()
            + &lines(1..=LINKS, select)
            + &lines(1..=SEARCHES, |at| format!("%distance{at} = OpPtrDiff %uint %p{LINKS} %first")),
        ..Shader::default()
    };
    // Every search comes to each link twice, as each selection names the one before it twice. The
    // operations of the module are fewer than those of one more such visit.
    let searched = (LINKS * SEARCHES) as u64;
    limited(&shader.bytes(), InputLimit::Operations, searched, 3 * searched);
}

/// Which element each invocation stores to is followed back through what computes the index.
#[test]
fn a_chain_of_sums_that_is_an_index() {
    let shader = Shader {
        body: "%i = OpLoad %uvec3 %id
             %s0 = OpCompositeExtract %uint %i 0\n"
            .to_owned()
            + &lines(1..=LONG, |at| format!("%s{at} = OpIAdd %uint %s{} %u1", at - 1))
            + &format!(
                "%back = OpConstant %uint {LONG}
                 %at = OpISub %uint %s{LONG} %back
                 %element = OpAccessChain %ptr_uint %out %u0 %at
                 OpStore %element %u2"
            ),
        ..Shader::default()
    };
    // A constant stands at module scope.
    let (body, back) = (shader.body.clone(), format!("%back = OpConstant %uint {LONG}"));
    let shader = Shader { body: body.replace(&back, ""), declarations: back, ..shader };
    follows("sums", &shader, 2);
}

#[test]
fn selections_and_loops_in_each_other() {
    const DEEP: usize = 1000;
    let open = |at: usize| {
        format!(
            "OpSelectionMerge %merge{at} None
             OpBranchConditional %less %then{at} %merge{at}
             %then{at} = OpLabel"
        )
    };
    let close = |at: usize| {
        let at = DEEP + 1 - at;
        format!("OpBranch %merge{at}\n%merge{at} = OpLabel")
    };
    let loops = |at: usize| {
        format!(
            "OpBranch %head{at}
             %head{at} = OpLabel
             OpLoopMerge %after{at} %next{at} None
             OpBranch %body{at}
             %body{at} = OpLabel"
        )
    };
    let ends = |at: usize| {
        let at = DEEP + 1 - at;
        format!(
            "OpBranch %next{at}
             %next{at} = OpLabel
             OpBranchConditional %less %after{at} %head{at}
             %after{at} = OpLabel"
        )
    };
    let shader = Shader {
        body: "%i = OpLoad %uvec3 %id
             %x = OpCompositeExtract %uint %i 0
             %less = OpULessThan %bool %x %u2\n"
            .to_owned()
            + &lines(1..=DEEP, open)
            + &lines(1..=DEEP, loops)
            + "OpStore %first %u2\n"
            + &lines(1..=DEEP, ends)
            + &lines(1..=DEEP, close),
        ..Shader::default()
    };
    follows("nested", &shader, 2);
}

#[test]
fn functions_that_call_functions() {
    const DEEP: usize = 3000;
    let function = |at: usize| {
        let inner = if at == DEEP {
            "OpStore %first_too %u2".to_owned()
        } else {
            format!("%r{at} = OpFunctionCall %void %f{}", at + 1)
        };
        let chain = if at == DEEP { "%first_too = OpAccessChain %ptr_uint %out %u0 %u0" } else { "" };
        format!(
            "%f{at} = OpFunction %void None %function
             %b{at} = OpLabel
             {chain}
             {inner}
             OpReturn
             OpFunctionEnd"
        )
    };
    let shader = Shader {
        body: "%called = OpFunctionCall %void %f1".into(),
        functions: lines(1..=DEEP, function),
        ..Shader::default()
    };
    follows("calls", &shader, 2);
}

/// Everything that walks a type does so in a small stack: as a value, in memory, made up.
#[test]
fn types_as_deep_as_they_may_be() {
    let deep = |at: usize| format!("%s{at} = OpTypeStruct %s{}", at - 1);
    let shader = Shader {
        annotations: lines(1..=250, |at| format!("OpMemberDecorate %s{at} 0 Offset 0"))
            + "OpDecorate %s250 Block
               OpDecorate %deep DescriptorSet 0
               OpDecorate %deep Binding 1",
        declarations: "%s0 = OpTypeStruct %uint\n".to_owned()
            + &lines(1..=250, deep)
            + "%ptr_deep = OpTypePointer StorageBuffer %s250
               %ptr_local = OpTypePointer Function %s250
               %deep = OpVariable %ptr_deep StorageBuffer
               %null = OpConstantNull %s250",
        body: "OpStore %first %u2".into(),
        ..Shader::default()
    };
    let shader = Shader {
        annotations: shader.annotations + "\nOpMemberDecorate %s0 0 Offset 0",
        body: "%local = OpVariable %ptr_local Function %null\n".to_owned()
            + &shader.body
            + "\n%whole = OpLoad %s250 %deep
               OpStore %local %whole
               OpStore %deep %whole",
        ..shader
    };
    let bytes = shader.bytes();
    assert!(lowered(&bytes).is_ok());
    let (verdict, text) = smoked(&bytes, InputLimits::default());
    assert_eq!(verdict, SmokeVerdict::Ok, "{text}");
    assert_eq!(program("inspect", "deep", &bytes, &[]).0, 0);
    assert_eq!(program("smoke", "deep", &bytes, &[]).0, 0);
}

/// A small module, the limit that it is beyond, and a value that lets it pass.
#[track_caller]
fn limited(bytes: &[u8], limit: InputLimit, small: u64, enough: u64) {
    let attempt = |value: u64| -> Result<()> {
        let module = Arc::new(module::load_with(bytes, InputLimits::default().with(limit, value))?);
        let options = LowerOptions { verify: false, ..LowerOptions::default() };
        lower_with(&module, &module.entry_points[0], options).map(|_| ())
    };
    let error = attempt(small).expect_err("the limit holds");
    assert_eq!(error.kind(), ErrorKind::UnsupportedModule);
    assert!(error.message().contains(&format!("the limit `{}` of {small}", limit.name())), "{error}");
    let named = format!("--limit {}=N", limit.name());
    assert!(error.notes().iter().any(|note| note.contains(&named)), "{error}");
    assert!(error.places().next().is_some(), "an error without a place: {error}");
    attempt(enough).expect("a raised limit lets the module pass");

    let name = limit.name();
    let file = format!("limit-{name}");
    let (code, out, err) = program("inspect", &file, bytes, &["--limit", &format!("{name}={small}")]);
    assert!((code == 5 && err.contains(&named)) || out.contains(&named), "{out}{err}");
    let (code, out, err) = program("inspect", &file, bytes, &["--limit", &format!("{name}={enough}")]);
    assert_eq!(code, 0, "{err}");
    assert!(!out.contains("--limit"), "{out}");
}

#[test]
fn each_limit_is_told_by_name_and_can_be_raised() {
    let plain = Shader::default().bytes();
    limited(&plain, InputLimit::ModuleBytes, 100, plain.len() as u64);
    limited(&plain, InputLimit::ModuleIds, 10, 100);
    limited(&plain, InputLimit::ModuleInstructions, 20, 100);
    limited(&plain, InputLimit::ModuleConstants, 2, 100);
    limited(&plain, InputLimit::TypeNesting, 2, 255);
    limited(&plain, InputLimit::TypeParts, 3, 100);
    let values = Shader {
        declarations: "%u100 = OpConstant %uint 100
             %words = OpTypeArray %uint %u100
             %ptr_words = OpTypePointer Private %words
             %ptr_shared = OpTypePointer Workgroup %words
             %private = OpVariable %ptr_words Private
             %shared = OpVariable %ptr_shared Workgroup"
            .into(),
        body: "%all = OpLoad %words %private
             OpStore %shared %all"
            .into(),
        ..Shader::default()
    }
    .bytes();
    limited(&values, InputLimit::Registers, 90, 1000);
    limited(&values, InputLimit::Operations, 50, 10_000);
    limited(&values, InputLimit::WorkgroupBytes, 399, 400);

    // A workgroup has one invocation, of more than a hundred registers.
    let compute = |limit: u64| -> Result<Compute> {
        let limits = InputLimits::default().with(InputLimit::WorkgroupRegisters, limit);
        let module = Arc::new(module::load_with(&values, limits)?);
        Compute::new(lower_with(&module, &module.entry_points[0], LowerOptions::default())?)
    };
    let error = compute(100).expect_err("the limit holds");
    assert_eq!(error.kind(), ErrorKind::UnsupportedModule);
    assert!(error.render().contains("raise it with `--limit workgroup-registers=N`"), "{error}");
    compute(1000).expect("a raised limit lets it pass");
}

/// What a smoke test says of a module's one entry point.
fn smoked(bytes: &[u8], limits: InputLimits) -> (SmokeVerdict, String) {
    let begin = Instant::now();
    let module = Arc::new(module::load_with(bytes, limits).expect("a module"));
    let report = SmokeReport::of(&module, SmokeOptions::default());
    assert!(begin.elapsed() < PATIENCE, "smoke took {:?}", begin.elapsed());
    (report.entry_points[0].result, report.text())
}

/// A block whose second member lies behind so many bytes.
fn distant(offset: u32) -> Vec<u8> {
    Shader {
        annotations: format!(
            "OpDecorate %Far Block
             OpMemberDecorate %Far 0 Offset 0
             OpMemberDecorate %Far 1 Offset {offset}
             OpDecorate %far DescriptorSet 0
             OpDecorate %far Binding 1"
        ),
        declarations: "%Far = OpTypeStruct %uint %uint
             %ptr_Far = OpTypePointer StorageBuffer %Far
             %far = OpVariable %ptr_Far StorageBuffer"
            .into(),
        body: "%second = OpAccessChain %ptr_uint %far %u0
             %word = OpLoad %uint %second
             OpStore %first %word"
            .into(),
        ..Shader::default()
    }
    .bytes()
}

#[test]
fn smoke_makes_up_no_larger_resources_than_it_may() {
    for offset in [1_000_000_000, 0xFFFF_FFFC] {
        let bytes = distant(offset);
        let (verdict, text) = smoked(&bytes, InputLimits::default());
        assert_eq!(verdict, SmokeVerdict::Limit, "{text}");
        assert!(text.contains("--limit smoke-resource-bytes=N"), "{text}");
        let (code, out, err) = program("smoke", &format!("far-{offset}"), &bytes, &[]);
        assert_eq!(code, 5, "{out}{err}");
        assert!(out.contains("the limit `smoke-resource-bytes` of 134217728"), "{out}");
    }
    // One resource passes, all of them do not.
    let bytes = distant(1000);
    let limits = InputLimits::default().with(InputLimit::SmokeLaunchBytes, 2000);
    let (verdict, text) = smoked(&bytes, limits);
    assert_eq!(verdict, SmokeVerdict::Limit, "{text}");
    assert!(text.contains("--limit smoke-launch-bytes=N"), "{text}");
    assert_eq!(smoked(&bytes, InputLimits::default()).0, SmokeVerdict::Ok);
}

/// A resource of a type, whose address a shader takes.
fn with_resource(ty: &str, block: bool, annotations: &str) -> Vec<u8> {
    let class = if block { "StorageBuffer" } else { "UniformConstant" };
    Shader {
        annotations: format!(
            "OpDecorate %resource DescriptorSet 0
             OpDecorate %resource Binding 1
             {annotations}"
        ),
        declarations: format!(
            "%u_many = OpConstant %uint 4000000000
             {ty}
             %ptr_Resource = OpTypePointer {class} %Resource
             %resource = OpVariable %ptr_Resource {class}"
        ),
        body: "%same = OpCopyObject %ptr_Resource %resource
             OpStore %first %u1"
            .into(),
        ..Shader::default()
    }
    .bytes()
}

/// Arrays of any length whose elements have no bytes, lie on each other, which is invalid (SPIR-V,
/// 2.16.2), or are descriptors.
#[test]
fn smoke_judges_odd_types_soon() {
    let block = "OpDecorate %Resource Block\nOpMemberDecorate %Resource 0 Offset 0";
    let arrays = "%a1 = OpTypeArray %Element %u_many
         %a2 = OpTypeArray %a1 %u_many
         %a3 = OpTypeArray %a2 %u_many
         %Resource = OpTypeStruct %a3";
    let strides = "OpDecorate %a1 ArrayStride 0\nOpDecorate %a2 ArrayStride 0\nOpDecorate %a3 ArrayStride 0";
    for (name, element) in
        [("nothing", "%Element = OpTypeStruct"), ("one place", "%Element = OpTypeInt 16 1")]
    {
        let bytes = with_resource(&format!("{element}\n{arrays}"), true, &format!("{block}\n{strides}"));
        let (verdict, text) = smoked(&bytes, InputLimits::default());
        assert_eq!(verdict, SmokeVerdict::Invalid, "{name}: {text}");
        assert_eq!(program("smoke", "odd", &bytes, &[]).0, 2, "{name}");
    }
    let nothing = "%Element = OpTypeStruct\n%a1 = OpTypeArray %Element %u_many\n%Resource = OpTypeStruct %a1";
    let bytes = with_resource(nothing, true, &format!("{block}\nOpDecorate %a1 ArrayStride 1"));
    let (verdict, text) = smoked(&bytes, InputLimits::default());
    assert_eq!(verdict, SmokeVerdict::Limit, "{text}");
    // As many structs on one place as a type may have, in as many elements as are filled.
    let doubled = "%d0 = OpTypeStruct %uint %uint\n".to_owned()
        + &lines(1..=17, |at| format!("%d{at} = OpTypeStruct %d{0} %d{0}", at - 1))
        + "%a1 = OpTypeRuntimeArray %d17\n%Resource = OpTypeStruct %a1";
    let offsets =
        lines(0..=17, |at| format!("OpMemberDecorate %d{at} 0 Offset 0\nOpMemberDecorate %d{at} 1 Offset 0"));
    let bytes = with_resource(&doubled, true, &format!("{block}\nOpDecorate %a1 ArrayStride 1\n{offsets}"));
    let (verdict, text) = smoked(&bytes, InputLimits::default());
    assert_eq!(verdict, SmokeVerdict::Invalid, "{text}");
    // Matrices on each other with columns of a quarter of a million components.
    let long = Shader {
        capabilities: "OpCapability LongVectorEXT
             OpExtension \"SPV_EXT_long_vector\""
            .into(),
        annotations: format!(
            "{block}
             OpMemberDecorate %Resource 0 ColMajor
             OpMemberDecorate %Resource 0 MatrixStride 4
             OpDecorate %matrices ArrayStride 4
             OpDecorate %resource DescriptorSet 0
             OpDecorate %resource Binding 1"
        ),
        declarations: "%u_rows = OpConstant %uint 262144
             %Column = OpTypeVectorIdEXT %float %u_rows
             %Matrix = OpTypeMatrix %Column 2
             %matrices = OpTypeArray %Matrix %u_rows
             %Resource = OpTypeStruct %matrices
             %ptr_Resource = OpTypePointer StorageBuffer %Resource
             %resource = OpVariable %ptr_Resource StorageBuffer"
            .into(),
        body: "%same = OpCopyObject %ptr_Resource %resource
             OpStore %first %u1"
            .into(),
        ..Shader::default()
    };
    let (verdict, text) = smoked(&long.bytes(), InputLimits::default());
    assert_eq!(verdict, SmokeVerdict::Invalid, "{text}");
    // A binding of four thousand million images has as many as a binding may have.
    let images = "%Image = OpTypeImage %float 2D 0 0 0 1 Unknown\n%Resource = OpTypeArray %Image %u_many";
    let (verdict, text) = smoked(&with_resource(images, false, ""), InputLimits::default());
    assert_ne!(verdict, SmokeVerdict::Bug, "{text}");
}

/// Two variables share a binding: a million buffers of a megabyte each, of which four differ.
#[test]
fn smoke_merges_what_shares_a_binding_soon() {
    let shader = Shader {
        annotations: "OpDecorate %large ArrayStride 1024
             OpDecorate %Large Block
             OpMemberDecorate %Large 0 Offset 0
             OpDecorate %one DescriptorSet 0
             OpDecorate %one Binding 1
             OpDecorate %other DescriptorSet 0
             OpDecorate %other Binding 1"
            .into(),
        declarations: "%large = OpTypeRuntimeArray %uint
             %Large = OpTypeStruct %large
             %u_many = OpConstant %uint 4000000000
             %all = OpTypeArray %Large %u_many
             %ptr_all = OpTypePointer StorageBuffer %all
             %one = OpVariable %ptr_all StorageBuffer
             %other = OpVariable %ptr_all StorageBuffer"
            .into(),
        body: "%same = OpCopyObject %ptr_all %one
             %same_other = OpCopyObject %ptr_all %other
             OpStore %first %u1"
            .into(),
        ..Shader::default()
    };
    let (verdict, text) = smoked(&shader.bytes(), InputLimits::default());
    assert_eq!(verdict, SmokeVerdict::Ok, "{text}");
}

/// No image with several samples is anything but 2D (VUID-VkImageCreateInfo-samples-02257).
#[test]
fn smoke_tells_of_images_that_cannot_be() {
    for dim in ["1D", "3D", "Cube", "Buffer"] {
        let image = format!("%Resource = OpTypeImage %float {dim} 0 0 1 1 Unknown");
        let shader = Shader {
            annotations: "OpDecorate %resource DescriptorSet 0
                 OpDecorate %resource Binding 1"
                .into(),
            declarations: format!(
                "{image}
                 %ptr_Resource = OpTypePointer UniformConstant %Resource
                 %resource = OpVariable %ptr_Resource UniformConstant"
            ),
            body: "%image = OpLoad %Resource %resource
                 %samples = OpImageQuerySamples %uint %image
                 OpStore %first %samples"
                .into(),
            ..Shader::default()
        };
        let bytes = shader.bytes();
        let (verdict, text) = smoked(&bytes, InputLimits::default());
        assert_eq!(verdict, SmokeVerdict::Unsupported, "{dim}: {text}");
        assert!(text.contains("VUID-VkImageCreateInfo-samples-02257"), "{text}");
        assert_eq!(program("smoke", &format!("samples-{dim}"), &bytes, &[]).0, 4);
    }
}

/// Values, stores and composites that a few words multiply end in an error, not in all memory.
#[test]
fn a_few_words_make_no_endless_program() {
    let large = "%u_large = OpConstant %uint 300000
         %large = OpTypeArray %uint %u_large
         %u_many = OpConstant %uint 4000000000
         %many = OpTypeArray %uint %u_many
         %empty = OpTypeStruct
         %empties = OpTypeArray %empty %u_many
         %more_empties = OpTypeArray %empties %u_many
         %Empties = OpTypeStruct %more_empties
         %ptr_large = OpTypePointer Function %large
         %ptr_Empties = OpTypePointer Function %Empties
         %null = OpConstantNull %large
         %nothing = OpConstantNull %Empties\n";
    let ptr_store = "OpDecorate %scattered ArrayStride 8
         OpDecorate %Scattered Block
         OpMemberDecorate %Scattered 0 Offset 0
         OpDecorate %buffer DescriptorSet 0
         OpDecorate %buffer Binding 1";
    let scattered = "%scattered = OpTypeArray %uint %u_large
         %Scattered = OpTypeStruct %scattered
         %ptr_Scattered = OpTypePointer StorageBuffer %Scattered
         %buffer = OpVariable %ptr_Scattered StorageBuffer";
    // A million words each, that take no register of their own.
    let stores = Shader {
        annotations: ptr_store.into(),
        declarations: format!("{large}{scattered}"),
        body: "%whole = OpLoad %Scattered %buffer\n".to_owned()
            + &lines(1..=1000, |_| "OpStore %buffer %whole".into()),
        ..Shader::default()
    };
    let inserts = Shader {
        declarations: large.into(),
        body: lines(1..=1000, |at| {
            let before = if at == 1 { "%null".to_owned() } else { format!("%v{}", at - 1) };
            format!("%v{at} = OpCompositeInsert %large %u1 {before} {at}")
        }),
        ..Shader::default()
    };
    let extracts = Shader {
        declarations: large.into(),
        body: lines(1..=20_000, |at| format!("%v{at} = OpCompositeExtract %uint %null {at}")),
        ..Shader::default()
    };
    for (name, shader) in [("stores", stores), ("inserts", inserts), ("extracts", extracts)] {
        let bytes = shader.bytes();
        let begin = Instant::now();
        let error = lowered(&bytes).expect_err("too many operations");
        assert!(begin.elapsed() < PATIENCE, "{name} took {:?}", begin.elapsed());
        assert!(error.to_string().contains("--limit operations=N"), "{name}: {error}");
        let (_, out, err) = program("inspect", name, &bytes, &[]);
        assert!(out.contains("--limit operations=N"), "{name}: {out}{err}");
    }
    let copies = Shader {
        declarations: large.to_owned() + "%other = OpTypeArray %uint %u_many",
        body: "%undefined = OpUndef %uint
             %logical = OpCopyLogical %many %null"
            .into(),
        ..Shader::default()
    };
    assert!(lowered(&copies.bytes()).is_err());
    // Nothing, 16 * 10^18 times.
    let empties = Shader {
        declarations: large.into(),
        body: "%local = OpVariable %ptr_Empties Function %nothing
             %all = OpLoad %Empties %local
             %same = OpCopyLogical %Empties %all
             OpStore %local %same
             OpStore %first %u2"
            .into(),
        ..Shader::default()
    };
    follows("empties", &empties, 2);
}

/// Sums of offsets and sizes that do not fit 32 bits are errors or traps, and never small numbers.
#[test]
fn offsets_beyond_32_bits_do_not_wrap() {
    let annotations = "OpDecorate %Far Block
         OpMemberDecorate %Far 0 Offset 4294967292
         OpMemberDecorate %Far 1 Offset 0
         OpMemberDecorate %Inner 0 Offset 8
         OpMemberDecorate %Nested 0 Offset 4294967292
         OpDecorate %Nested Block
         OpDecorate %far DescriptorSet 0
         OpDecorate %far Binding 0
         OpDecorate %nested DescriptorSet 0
         OpDecorate %nested Binding 0";
    let declarations = "%Far = OpTypeStruct %uint %uint
         %Inner = OpTypeStruct %uint
         %Nested = OpTypeStruct %Inner
         %ptr_Far = OpTypePointer StorageBuffer %Far
         %ptr_Nested = OpTypePointer StorageBuffer %Nested
         %far = OpVariable %ptr_Far StorageBuffer
         %nested = OpVariable %ptr_Nested StorageBuffer";
    let body = |text: &str| Shader {
        annotations: annotations.into(),
        declarations: declarations.into(),
        body: text.into(),
        ..Shader::default()
    };
    // Two words, of which the one behind 4 GiB is not there.
    let whole =
        body("%whole = OpLoad %Far %far\n%word = OpCompositeExtract %uint %whole 1\nOpStore %first %word");
    assert_eq!(first_word(&whole.bytes()).expect("the second word is there"), 0);
    let both =
        body("%whole = OpLoad %Far %far\n%word = OpCompositeExtract %uint %whole 0\nOpStore %first %word");
    assert_eq!(first_word(&both.bytes()).unwrap_err().kind(), ErrorKind::Trap);
    // 2^32 + 4 is no 4.
    let beyond = body("%inner = OpAccessChain %ptr_uint %nested %u0 %u0\nOpStore %inner %u1");
    let error = first_word(&beyond.bytes()).unwrap_err();
    assert!(error.message().contains("an offset beyond 4 GiB"), "{error}");
}

/// Of an array of four thousand million numbers, or of nothing, that lies in sixteen bytes, what
/// these hold is shown.
#[test]
fn declared_arrays_are_read_as_far_as_their_buffer_reaches() {
    let third = "%third = OpAccessChain %ptr_uint %many %u0 %u2\nOpStore %third %u2";
    for (name, element, body, shown) in [
        // The third of four numbers is set, and what has no bytes has no parts.
        ("numbers", "%uint", third, "_0 = [0, 0, 2, 0]\n"),
        ("nothing", "%Empty", "%same = OpCopyObject %ptr_Many %many", "_0 = []\n"),
    ] {
        let shader = Shader {
            annotations: "OpDecorate %Many Block
                 OpMemberDecorate %Many 0 Offset 0
                 OpDecorate %parts ArrayStride 4
                 OpDecorate %many DescriptorSet 0
                 OpDecorate %many Binding 1"
                .into(),
            declarations: format!(
                "%u_many = OpConstant %uint 4000000000
                 %Empty = OpTypeStruct
                 %parts = OpTypeArray {element} %u_many
                 %Many = OpTypeStruct %parts
                 %ptr_Many = OpTypePointer StorageBuffer %Many
                 %many = OpVariable %ptr_Many StorageBuffer"
            ),
            body: body.into(),
            ..Shader::default()
        };
        let text = dumped(&format!("declared-{name}"), &shader);
        assert!(text.contains(shown), "{name}: {text}");
    }
}

/// Two members in the same bytes, of a type that has two members in the same bytes, and so on: 2^18
/// numbers in four bytes. They overlap (SPIR-V, 2.16.2).
#[test]
fn members_that_share_their_bytes_are_refused_soon() {
    let each = |line: &dyn Fn(usize) -> String| lines(1..=18, line);
    let shader = Shader {
        annotations: "OpDecorate %Many Block
             OpMemberDecorate %Many 0 Offset 0
             OpMemberDecorate %Twice0 0 Offset 0
             OpDecorate %many DescriptorSet 0
             OpDecorate %many Binding 1\n"
            .to_owned()
            + &each(&|at| {
                format!("OpMemberDecorate %Twice{at} 0 Offset 0\nOpMemberDecorate %Twice{at} 1 Offset 0")
            }),
        declarations: "%Twice0 = OpTypeStruct %uint\n".to_owned()
            + &each(&|at| format!("%Twice{at} = OpTypeStruct %Twice{0} %Twice{0}", at - 1))
            + "%Many = OpTypeStruct %Twice18
             %ptr_Many = OpTypePointer StorageBuffer %Many
             %many = OpVariable %ptr_Many StorageBuffer",
        body: "%size = OpCopyObject %ptr_Many %many".into(),
        ..Shader::default()
    };
    let (verdict, text) = smoked(&shader.bytes(), InputLimits::default());
    assert_eq!(verdict, SmokeVerdict::Invalid, "{text}");
    assert!(text.contains("at offset 0 overlaps member 0 of"), "{text}");
}

/// What is shown of a buffer of sixteen bytes at binding 1 when a shader has run.
fn dumped(name: &str, shader: &Shader) -> String {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("load-limits-{name}"));
    std::fs::create_dir_all(&folder).expect("a writable folder");
    let file = |name: &str| folder.join(name);
    std::fs::write(file("many.spv"), shader.bytes()).expect("a writable folder");
    let scene = "version = 1\n[shaders]\nmain = 'many.spv'\n[[dispatch]]\nshader = 'main'\n\
                 [resources.first]\ntype = 'storage_buffer'\nbinding = 0\nsize = 16\n\
                 [resources.many]\ntype = 'storage_buffer'\nbinding = 1\nsize = 16\n";
    std::fs::write(file("scene.toml"), scene).expect("a writable folder");
    let begin = Instant::now();
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .args(["run", "scene.toml", "--dump", "many"])
        .current_dir(&folder)
        .stdin(Stdio::null())
        .output()
        .expect("the command starts");
    assert!(begin.elapsed() < PATIENCE, "it took {:?}", begin.elapsed());
    let text = String::from_utf8([output.stdout, output.stderr].concat()).expect("UTF-8");
    assert!(output.status.success(), "{text}");
    text
}
