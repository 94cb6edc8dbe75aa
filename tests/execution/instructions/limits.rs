//! Shaders that never end, or not within a lifetime: each limit of running stops them, soon and at
//! the same place whatever runs beside it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhit::{Module, Program, Ray};
use anyhit_base::error::{Error, Result};
use anyhit_engine::accel::{
    Blas, Geometry, GeometryData, GeometryFlags, RayFlags, Tlas, TlasInstance, TraceRay,
};
use anyhit_engine::machine::{Buffer, Descriptor, LaunchLimits, Printed, PrintedBytes, Resources, TrapCode};
use anyhit_engine::pipeline::{
    BatchWidth, Compute, GREATEST_CALLABLE_DEPTH, Launch, Pipeline, RayOperands, RunOptions,
};

use crate::execution::instructions::run::Shader;
use crate::execution::instructions::workgroup::Workgroup;
use crate::support::assembly::assemble;

/// In which an endless launch ends, on a machine that others use, too, without much optimization.
const SOON: Duration = Duration::from_secs(10);

/// Runs what must end soon with a trap.
fn stopped<T>(run: impl FnOnce() -> Result<T>) -> Error {
    let begin = Instant::now();
    let Err(error) = run() else { panic!("it ends, though it should not") };
    assert!(begin.elapsed() < SOON, "after {:?}: {}", begin.elapsed(), error.render());
    error
}

fn assert_code(error: &Error, code: TrapCode) {
    assert_eq!(code_of(error), Some(code), "{}", error.render());
}

fn code_of(error: &Error) -> Option<TrapCode> {
    error.trap().map(|trap| trap.code)
}

fn is_limit(error: &Error) -> bool {
    code_of(error).is_some_and(TrapCode::is_limit)
}

fn output(words: usize) -> (Arc<Buffer>, Resources) {
    let out = Buffer::zeroed(words * 4);
    let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
    (out, resources)
}

/// A ray generation program beside the prelude of [`Shader`].
fn pipeline(shader: &Shader<'_>, fuel: Option<u64>, limits: LaunchLimits) -> Pipeline {
    let mut builder = Pipeline::builder();
    builder =
        builder.ray_generation(shader.program()).expect("a ray generation shader").launch_limits(limits);
    if let Some(fuel) = fuel {
        builder = builder.fuel(fuel);
    }
    builder.build().expect("a pipeline")
}

/// A tree of functions, each of which calls the next one twice; the last counts its calls.
fn tree(levels: u32) -> Arc<Module> {
    let mut functions = String::new();
    for level in 0..levels {
        let calls = match level + 1 == levels {
            true => format!(
                "%at{level} = OpAccessChain %ptr_uint %out %0 %0
                 %old{level} = OpAtomicIAdd %uint %at{level} %1 %0 %1\n"
            ),
            false => format!(
                "%a{level} = OpFunctionCall %void %f{next}
                 %b{level} = OpFunctionCall %void %f{next}\n",
                next = level + 1
            ),
        };
        functions += &format!(
            "%f{level} = OpFunction %void None %function
             %l{level} = OpLabel
             {calls}
             OpReturn
             OpFunctionEnd\n"
        );
    }
    let body = "%called = OpFunctionCall %void %f0";
    Workgroup { size: 1, body, functions: &functions, ..Workgroup::default() }.module()
}

#[test]
fn a_call_costs_what_it_runs() {
    for fuel in [1 << 12, 1 << 16] {
        // 2^39 calls of the last function.
        let compute = Compute::new(Program::of(&tree(40), "main").expect("a program")).expect("compute");
        let compute = compute.fuel(fuel);
        let (out, resources) = output(1);
        let error = stopped(|| compute.dispatch(&resources, [1, 1, 1]));
        assert_code(&error, TrapCode::OutOfFuel);
        assert!(error.render().contains(&format!("fuel = {fuel} ")), "{}", error.render());
        // Each call of the last function runs more instructions than one, beyond those that a
        // function of 2,000 instructions has, which is inlined.
        let calls = u64::from(out.load(0, 32).expect("a word"));
        assert!(calls <= fuel + 2_000, "{calls} calls for {fuel} instructions");
    }
    // A tree of 2^9 calls is not refused.
    let compute = Compute::new(Program::of(&tree(10), "main").expect("a program")).expect("compute");
    let (out, resources) = output(1);
    compute.fuel(1 << 16).dispatch(&resources, [1, 1, 1]).expect("a tree that ends");
    assert_eq!(out.load(0, 32), Some(1 << 9));
}

/// A loop whose invocations of a workgroup wait for each other in every turn.
const BARRIERS: &str = "
    OpBranch %loop
    %loop = OpLabel
    OpLoopMerge %never %next None
    OpBranch %next
    %next = OpLabel
    OpControlBarrier %2 %2 %264
    OpBranchConditional %true %loop %never
    %never = OpLabel";

#[test]
fn a_barrier_in_an_endless_loop_ends() {
    for lanes in [BatchWidth::One, BatchWidth::Of64] {
        let compute = Workgroup {
            size: 1024,
            declarations: "%true = OpConstantTrue %bool",
            body: BARRIERS,
            ..Workgroup::default()
        }
        .compute()
        .launch_limits(LaunchLimits::TESTS);
        let (_, resources) = output(1);
        let error = stopped(|| compute.run(&resources, [2, 1, 1], RunOptions::of(lanes)));
        let ended = [TrapCode::LaunchOutOfFuel, TrapCode::BatchTimedOut];
        let code = code_of(&error).expect("a trap");
        assert!(ended.contains(&code), "{lanes} lanes: {}", error.render());
        assert!(error.render().contains("workgroup (0, 0, 0)"), "{}", error.render());
    }
}

/// A loop without end for the invocations from one on; `turns` counts.
fn endless(from: u32) -> Shader<'static> {
    let body = format!(
        "%turns = OpVariable %ptr_Function_uint Function
         %is_endless = OpUGreaterThanEqual %bool %id %u{from}
         OpStore %turns %u0
         OpBranch %header
         %header = OpLabel
         OpLoopMerge %merge %latch None
         OpBranchConditional %is_endless %latch %merge
         %latch = OpLabel
         %before = OpLoad %uint %turns
         %after = OpIAdd %uint %before %u1
         OpStore %turns %after
         OpBranch %header
         %merge = OpLabel
         %last = OpLoad %uint %turns
         out 0 %last"
    );
    Shader { body: String::leak(body), annotations: "OpName %turns \"turns\"", ..Shader::default() }
}

#[test]
fn the_first_invocation_without_fuel_stops_those_behind_it() {
    // 64 x 256 invocations, of which each would run for a second or more.
    let shader = endless(0);
    let pipeline = pipeline(&shader, Some(1 << 20), LaunchLimits::default());
    let (_, resources) = output(64 * 256 * 16);
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let one = stopped(|| launch.run([64, 256, 1], RunOptions::of(BatchWidth::One)));
    let many = stopped(|| launch.run([64, 256, 1], RunOptions::default()));
    assert_code(&one, TrapCode::OutOfFuel);
    assert!(one.render().contains("launch id (0, 0, 0)"), "{}", one.render());
    assert_eq!(one.render(), many.render());
}

/// The endless invocation spends more than these limits and less than those of the pipeline.
#[test]
fn the_limits_of_a_run_take_the_place_of_the_pipelines() {
    let pipeline = pipeline(&endless(0), None, LaunchLimits::default());
    let (_, resources) = output(16);
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let options = RunOptions::default().limits(LaunchLimits::default().fuel(1 << 12));
    let error = stopped(|| launch.run([1, 1, 1], options));
    assert_code(&error, TrapCode::LaunchOutOfFuel);

    let compute = Workgroup {
        size: 64,
        declarations: "%true = OpConstantTrue %bool",
        body: BARRIERS,
        ..Workgroup::default()
    }
    .compute();
    let (_, resources) = output(1);
    let error = stopped(|| compute.run(&resources, [1, 1, 1], options));
    assert_code(&error, TrapCode::LaunchOutOfFuel);
}

#[test]
fn a_launch_of_endless_invocations_ends_within_the_limits_of_tests() {
    let pipeline = pipeline(&endless(0), None, LaunchLimits::TESTS);
    let (_, resources) = output(64 * 256 * 16);
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let error = stopped(|| launch.run([64, 256, 1], RunOptions::default()));
    assert!(is_limit(&error), "{}", error.render());
}

#[test]
fn the_invocation_that_is_told_depends_on_no_thread() {
    let runs = [1, 2, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        // Invocation 29 is the first without end, in every row; then all invocations together.
        let fuel = pipeline(&endless(29), Some(1 << 18), LaunchLimits::default());
        let limits = LaunchLimits::default().fuel(1 << 20);
        let together = pipeline(&endless(29), Some(1 << 12), limits);
        [fuel, together].map(|pipeline| {
            let (_, resources) = output(64 * 40 * 16);
            let launch = Launch { pipeline: &pipeline, resources: &resources };
            stopped(|| pool.install(|| launch.run([64, 40, 1], RunOptions::default()))).render()
        })
    });
    assert!(runs[0][0].contains("launch id (29, 0, 0)"), "{}", runs[0][0]);
    assert_eq!(runs[0], runs[1]);
    assert_eq!(runs[0], runs[2]);
}

#[test]
fn invocations_that_end_may_still_be_too_much_together() {
    // Each invocation turns 32 times; 2560 of them together spend more than a million
    // instructions in loops of at least five.
    let body = "
        OpBranch %header
        %header = OpLabel
        %turn = OpPhi %uint %u0 %entry %after %latch
        %more = OpULessThan %bool %turn %u32
        OpLoopMerge %merge %latch None
        OpBranchConditional %more %latch %merge
        %latch = OpLabel
        %after = OpIAdd %uint %turn %u1
        OpBranch %header
        %merge = OpLabel
        out 0 %turn";
    let shader = Shader { body, ..Shader::default() };
    let run = |fuel: u64, threads: usize| {
        let limits = LaunchLimits::default().fuel(fuel);
        let pipeline = pipeline(&shader, None, limits);
        let (_, resources) = output(2560 * 16);
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| launch.run([2560, 1, 1], RunOptions::default()))
    };
    let errors = [1, 2, 4].map(|threads| stopped(|| run(200_000, threads)));
    assert_code(&errors[0], TrapCode::LaunchOutOfFuel);
    let text = errors[0].render();
    assert!(text.contains("launch_fuel = 200000 ") && text.contains("--launch-fuel"), "{text}");
    assert!(errors.iter().all(|error| error.render() == text), "{errors:?}");
    run(1 << 30, 2).expect("a launch within its fuel");
}

#[test]
fn the_report_tells_what_the_variables_of_the_loop_did() {
    let error = Shader { fuel: Some(4096), ..endless(3) }.refused();
    let text = error.render();
    assert_code(&error, TrapCode::OutOfFuel);
    assert!(text.contains("launch id (3, 0, 0)"), "{text}");
    assert!(text.contains("`turns` changed from 1 to "), "{text}");
    assert!(text.contains("fuel = 4096 "), "{text}");
}

#[test]
fn a_variable_that_does_not_change_is_told() {
    // The bound moves on with the counter, and the step is never 2: `step` stays 0.
    let error = Shader {
        annotations: "OpName %turn \"turn\"\nOpName %step \"step\"",
        body: "
            OpBranch %header
            %header = OpLabel
            %turn = OpPhi %uint %u0 %entry %after %latch
            %step = OpPhi %uint %u0 %entry %kept %latch
            %more = OpULessThan %bool %step %u2
            OpLoopMerge %merge %latch None
            OpBranchConditional %more %latch %merge
            %latch = OpLabel
            %after = OpIAdd %uint %turn %u2
            %kept = OpBitwiseAnd %uint %step %turn
            OpBranch %header
            %merge = OpLabel
            out 0 %turn",
        fuel: Some(2000),
        ..Shader::default()
    }
    .refused();
    let text = error.render();
    assert!(text.contains("`turn` changed from 2 to ") && text.contains("unchanged: `step` = 0"), "{text}");
}

fn shader(stage: &str, declarations: &str, body: &str) -> Program {
    let text = format!(
        "OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint {stage} %main \"main\"
         {declarations}
         %void = OpTypeVoid
         %function = OpTypeFunction %void
         %main = OpFunction %void None %function
         %start = OpLabel
         {body}
         OpFunctionEnd"
    );
    let module = Arc::new(anyhit_engine::module::load(&assemble(&text)).expect("a module"));
    Program::of(&module, "main").expect("a shader")
}

#[test]
fn an_endless_loop_of_reports_ends() {
    let intersection = shader(
        "IntersectionKHR",
        "%bool = OpTypeBool
         %uint = OpTypeInt 32 0
         %float = OpTypeFloat 32
         %zero = OpConstant %uint 0
         %half = OpConstant %float 0.5
         %true = OpConstantTrue %bool",
        "OpBranch %loop
         %loop = OpLabel
         OpLoopMerge %never %next None
         OpBranch %next
         %next = OpLabel
         %accepted = OpReportIntersectionKHR %bool %half %zero
         OpBranchConditional %true %loop %never
         %never = OpLabel
         OpReturn",
    );
    let any_hit = shader("AnyHitKHR", "", "OpIgnoreIntersectionKHR");
    let data = GeometryData::Aabbs(vec![[-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]]);
    let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::default())]).expect("a box");
    let transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let tlas = Tlas::new(vec![TlasInstance::of(blas, transform)]).expect("an instance");
    let mut builder = Pipeline::builder();
    builder = builder.hit([intersection, any_hit]).expect("a hit group").launch_limits(LaunchLimits::TESTS);
    let (pipeline, resources) = (builder.build().expect("a pipeline"), Resources::default());
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let ray = Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]).with_interval(0.0, 100.0);
    let trace = TraceRay { ray, flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 };
    let operands = RayOperands { trace, sbt_offset: 0, sbt_stride: 0, miss_index: 0, payload: Vec::new() };
    let error = stopped(|| launch.trace(&tlas, operands, None));
    assert!(is_limit(&error), "{}", error.render());
}

/// A callable shader that calls itself twice: a tree of 2^1024 calls.
fn calls_itself(calls: usize) -> Shader<'static> {
    let mut body = String::new();
    (0..calls).for_each(|_| body += "OpExecuteCallableKHR %u0 %data\n");
    Shader {
        annotations: "OpEntryPoint CallableKHR %callee \"callee\"",
        declarations: "
            %ptr_CallableData_uint = OpTypePointer CallableDataKHR %uint
            %data = OpVariable %ptr_CallableData_uint CallableDataKHR",
        body: "OpExecuteCallableKHR %u0 %data",
        functions: String::leak(format!(
            "%callee = OpFunction %void None %main_type
             %callee_entry = OpLabel
             {body}
             OpReturn
             OpFunctionEnd"
        )),
        ..Shader::default()
    }
}

fn callable_pipeline(shader: &Shader<'_>, depth: u32, limits: LaunchLimits) -> Result<Pipeline> {
    let module = shader.program().module;
    let callee = module.entry_points.iter().find(|entry| entry.name == "callee").expect("an entry point");
    Pipeline::builder()
        .ray_generation(shader.program())?
        .callable(anyhit_engine::program::lower(&module, callee)?)?
        .max_callable_depth(depth)
        .launch_limits(limits)
        .build()
}

#[test]
fn callable_shaders_nest_as_deeply_as_is_allowed() {
    let (_, resources) = output(16);
    for depth in [1, 7] {
        let pipeline =
            callable_pipeline(&calls_itself(1), depth, LaunchLimits::default()).expect("a pipeline");
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        let error = stopped(|| launch.run([1, 1, 1], RunOptions::of(BatchWidth::One)));
        assert_code(&error, TrapCode::CallablesTooDeep);
        let text = error.render();
        assert!(text.contains(&format!("max_callable_depth = {depth}:")), "{text}");
        // The ray generation shader and all callable shaders but the innermost one, which calls.
        assert_eq!(text.matches("called by").count() as u32, depth, "{text}");
    }
    for depth in [0, GREATEST_CALLABLE_DEPTH + 1, u32::MAX] {
        let error = callable_pipeline(&calls_itself(1), depth, LaunchLimits::default());
        assert!(error.expect_err("a limit").message().contains("max_callable_depth"));
    }
}

#[test]
fn callable_shaders_hold_no_more_than_the_stack_has() {
    // Each call holds an array of 2^16 registers, as its index is computed: 2^18 bytes. 2^23 bytes
    // are full behind 32 calls, which are far from the greatest depth.
    let shader = Shader {
        declarations: "
            %ptr_CallableData_uint = OpTypePointer CallableDataKHR %uint
            %data = OpVariable %ptr_CallableData_uint CallableDataKHR
            %u65536 = OpConstant %uint 65536
            %many = OpTypeArray %uint %u65536
            %ptr_Private_many = OpTypePointer Private %many
            %held = OpVariable %ptr_Private_many Private",
        functions: "
            %callee = OpFunction %void None %main_type
            %callee_entry = OpLabel
            %ids = OpLoad %uint3 %launch_id
            %at = OpCompositeExtract %uint %ids 0
            %place = OpAccessChain %ptr_Private_uint %held %at
            OpStore %place %u1
            OpExecuteCallableKHR %u0 %data
            %kept = OpLoad %uint %place
            OpStore %data %kept
            OpReturn
            OpFunctionEnd",
        ..calls_itself(1)
    };
    let (_, resources) = output(16);
    let mut pipeline = callable_pipeline(&shader, 1024, LaunchLimits::default()).expect("a pipeline");
    for (bytes, code) in [(1 << 23, TrapCode::StackOverflow), (1 << 40, TrapCode::CallablesTooDeep)] {
        pipeline.max_stack_size = bytes;
        // Not all 1024 calls: they are 256 MiB.
        pipeline.max_callable_depth = 40;
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        let error = stopped(|| launch.run([1, 1, 1], RunOptions::of(BatchWidth::One)));
        assert_code(&error, code);
        let text = error.render();
        let told = text.contains("max_stack_size = 8388608 bytes of registers");
        assert_eq!(told, code == TrapCode::StackOverflow, "{text}");
    }
}

#[test]
fn a_tree_of_callable_shaders_without_end_ends() {
    let (_, resources) = output(16);
    // The calls below 40 levels come back, so that each has two: 2^40 calls.
    let body = "
        %level = OpLoad %uint %incoming
        %deeper = OpIAdd %uint %level %u1
        OpStore %data %deeper
        %more = OpULessThan %bool %deeper %forty
        OpSelectionMerge %end None
        OpBranchConditional %more %again %end
        %again = OpLabel
        OpExecuteCallableKHR %u0 %data
        OpStore %data %deeper
        OpExecuteCallableKHR %u0 %data
        OpBranch %end
        %end = OpLabel";
    let shader = Shader {
        declarations: "
            %ptr_CallableData_uint = OpTypePointer CallableDataKHR %uint
            %data = OpVariable %ptr_CallableData_uint CallableDataKHR
            %ptr_Incoming_uint = OpTypePointer IncomingCallableDataKHR %uint
            %incoming = OpVariable %ptr_Incoming_uint IncomingCallableDataKHR
            %forty = OpConstant %uint 40",
        functions: &format!(
            "%callee = OpFunction %void None %main_type
             %callee_entry = OpLabel
             {body}
             OpReturn
             OpFunctionEnd"
        ),
        ..calls_itself(1)
    };
    let pipeline = callable_pipeline(&shader, 1024, LaunchLimits::TESTS).expect("a pipeline");
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let error = stopped(|| launch.run([1, 1, 1], RunOptions::default()));
    assert!(is_limit(&error), "{}", error.render());
}

#[test]
fn rays_recur_no_deeper_than_hardware_might() {
    for (depth, is_allowed) in [(31, true), (1024, true), (1025, false), (1_000_000, false)] {
        let built = Pipeline::builder().max_recursion(depth).build();
        assert_eq!(built.is_ok(), is_allowed, "{depth}");
        if let Err(error) = built {
            assert!(error.render().contains("exceeds the limit 1024"), "{}", error.render());
        }
    }
}

#[test]
fn a_loop_that_prints_keeps_no_more_than_is_allowed() {
    let shader = Shader {
        annotations: "%format = OpString \"turn %u of %u\"",
        body: "
            OpBranch %header
            %header = OpLabel
            %turn = OpPhi %uint %u0 %entry %after %latch
            OpLoopMerge %merge %latch None
            OpBranchConditional %true %latch %merge
            %latch = OpLabel
            %a = OpExtInst %void %printf 1 %format %turn %id
            %after = OpIAdd %uint %turn %u1
            OpBranch %header
            %merge = OpLabel",
        ..Shader::default()
    };
    let pipeline = pipeline(&shader, Some(1 << 16), LaunchLimits::default());
    let kept = [BatchWidth::One, BatchWidth::Of64].map(|lanes| {
        let printed = Arc::new(Printed::default());
        let (_, mut resources) = output(1);
        resources.printed = Some(printed.clone());
        resources.printed_bytes = PrintedBytes(10_000);
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        let error = stopped(|| launch.run([64, 1, 1], RunOptions::of(lanes)));
        assert_code(&error, TrapCode::OutOfFuel);
        let mut lines: Vec<String> = printed.take().into_iter().map(|line| line.text).collect();
        let cut = lines.pop().expect("a last line");
        assert!(cut.contains(" cut: the limit is printed_bytes = 10000"), "{cut}");
        lines
    });
    // A text has some 11 to 13 bytes and 64 more.
    assert!((120..140).contains(&kept[0].len()), "{}", kept[0].len());
    assert_eq!(kept[0], kept[1]);
    let expected = (0..kept[0].len()).map(|turn| format!("turn {turn} of 0"));
    assert!(kept[0].iter().cloned().eq(expected), "{:?}", kept[0]);
}

#[test]
fn the_clock_ends_a_launch_and_a_batch() {
    let quarter = Duration::from_millis(250);
    for (limits, code, name) in [
        (LaunchLimits::default().timeout(quarter), TrapCode::LaunchTimedOut, "timeout"),
        (LaunchLimits::default().batch_timeout(quarter), TrapCode::BatchTimedOut, "batch_timeout"),
    ] {
        let pipeline = pipeline(&endless(0), Some(u64::MAX), limits);
        let (_, resources) = output(64 * 64 * 16);
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        let error = stopped(|| launch.run([64, 64, 1], RunOptions::default()));
        assert_code(&error, code);
        let text = error.render();
        assert!(text.contains(&format!("the limit is {name} = 0.25 s")), "{text}");
        assert!(text.contains("depends on the machine"), "{text}");
        assert!(text.contains("`turns` changed from "), "{text}");
    }
}
