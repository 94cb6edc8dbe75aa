//! Closest-hit and miss shaders that leave nothing but words of a payload that nobody reads do not
//! run; those that leave anything else do.

use std::sync::Arc;

use anyhit::Result;
use anyhit_engine::accel::{Blas, Geometry, GeometryData, GeometryFlags, Tlas, TlasInstance};
use anyhit_engine::machine::{Buffer, Descriptor, OpIndex, Resources};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::{Event, Launch, Pipeline, RunOptions, Stats};
use anyhit_engine::program::Program;

use crate::support::assembly;

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

fn shader(stage: &str, payload: &str, body: &str) -> Program {
    shader_with("OpTypeStruct %uint %uint", stage, payload, body)
}

/// A shader of a stage. It may use a buffer of words (%first and %second point to two), the scene,
/// a payload of two words, of which %low and %high point to one each, callable data, and numbers.
fn shader_with(pair: &str, stage: &str, payload: &str, body: &str) -> Program {
    let text = format!(
        "OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpExtension \"SPV_KHR_non_semantic_info\"
         %printf = OpExtInstImport \"NonSemantic.DebugPrintf\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint {stage} %main \"main\" %payload %scene %outputs %data %id
         %format = OpString \"here\"
         OpDecorate %scene DescriptorSet 0
         OpDecorate %scene Binding 0
         OpDecorate %outputs DescriptorSet 0
         OpDecorate %outputs Binding 1
         OpDecorate %Outputs Block
         OpMemberDecorate %Outputs 0 Offset 0
         OpDecorate %array ArrayStride 4
         OpDecorate %id BuiltIn LaunchIdKHR
         %void = OpTypeVoid
         %function = OpTypeFunction %void
         %bool = OpTypeBool
         %uint = OpTypeInt 32 0
         %float = OpTypeFloat 32
         %vec3 = OpTypeVector %float 3
         %uvec3 = OpTypeVector %uint 3
         %0 = OpConstant %uint 0
         %1 = OpConstant %uint 1
         %2 = OpConstant %uint 2
         %255 = OpConstant %uint 255
         %0f = OpConstant %float 0.0
         %4f = OpConstant %float 4.0
         %9f = OpConstant %float 9.0
         %minus = OpConstant %float -1.0
         %origin = OpConstantComposite %vec3 %0f %0f %4f
         %down = OpConstantComposite %vec3 %0f %0f %minus
         %as = OpTypeAccelerationStructureKHR
         %as_pointer = OpTypePointer UniformConstant %as
         %scene = OpVariable %as_pointer UniformConstant
         %array = OpTypeRuntimeArray %uint
         %Outputs = OpTypeStruct %array
         %outputs_pointer = OpTypePointer StorageBuffer %Outputs
         %outputs = OpVariable %outputs_pointer StorageBuffer
         %word = OpTypePointer StorageBuffer %uint
         %pair = {pair}
         %pair_pointer = OpTypePointer {payload} %pair
         %part = OpTypePointer {payload} %uint
         %payload = OpVariable %pair_pointer {payload}
         %data_pointer = OpTypePointer CallableDataKHR %uint
         %data = OpVariable %data_pointer CallableDataKHR
         %id_pointer = OpTypePointer Input %uvec3
         %id = OpVariable %id_pointer Input
         %main = OpFunction %void None %function
         %start = OpLabel
         %low = OpAccessChain %part %payload %0
         %high = OpAccessChain %part %payload %1
         %first = OpAccessChain %word %outputs %0 %0
         %second = OpAccessChain %word %outputs %0 %1
         {body}
         OpReturn
         OpFunctionEnd"
    );
    let module = Arc::new(anyhit_engine::module::load(&assembly::assemble(&text)).expect("a module"));
    Program::of(&module, "main").expect("a shader")
}

const TRACE: &str = "%structure = OpLoad %as %scene
     OpTraceRayKHR %structure %0 %255 %0 %0 %0 %origin %0f %down %9f %payload";
/// Reads the low word of the payload into the buffer.
const READS_LOW: &str = "%read = OpLoad %uint %low
     OpStore %first %read";

fn ray_generation(body: &str) -> Program {
    shader("RayGenerationKHR", "RayPayloadKHR", body)
}

fn closest_hit(body: &str) -> Program {
    shader("ClosestHitKHR", "IncomingRayPayloadKHR", body)
}

/// A launch of three invocations, whose rays all hit a sphere (radius 1) or, with a radius of 0,
/// miss; what it did, and the first two words of the buffer.
fn launch(ray_generation: Program, called: Program, radius: f32, watched: bool) -> Result<(Stats, [u32; 2])> {
    let data = GeometryData::Spheres { positions: vec![[0.0; 3]], radii: vec![radius], indices: None };
    let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)])?;
    let tlas = Tlas::new(vec![TlasInstance::of(blas, IDENTITY)])?;
    let mut builder = Pipeline::builder();
    builder = builder.ray_generation(ray_generation)?;
    match called.stage {
        Stage::Miss => builder = builder.miss(called)?,
        _ => builder = builder.hit([called])?,
    };
    let (pipeline, buffer) = (builder.build()?, Buffer::zeroed(8));
    let resources = Resources::default().bind(0, 0, Descriptor::AccelerationStructure(tlas)).bind(
        0,
        1,
        Descriptor::Buffer(buffer.clone()),
    );
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let stats = match watched {
        false => launch.run([3, 1, 1], RunOptions::default())?,
        true => launch.run_observed([3, 1, 1], &mut |_: Event| (), &mut ())?,
    };
    Ok((stats, [buffer.load(0, 32).unwrap_or(0), buffer.load(4, 32).unwrap_or(0)]))
}

/// Invocations and batches of a stage, and how many were elided as nobody reads what they leave.
fn counts(stats: &Stats, stage: Stage) -> (u64, u64, u64) {
    let counted = stats.shaders[&stage];
    (counted.invocations, counted.batches, stats.elided.unread)
}

#[test]
fn a_closest_hit_shader_whose_payload_nobody_reads_is_counted_and_not_run() -> Result<()> {
    let writes = || closest_hit("OpStore %low %2\n OpStore %high %2");
    let (stats, _) = launch(ray_generation(TRACE), writes(), 1.0, false)?;
    assert_eq!(counts(&stats, Stage::ClosestHit), (3, 0, 3));
    // What is read first is what was written over it.
    let (stats, words) =
        launch(ray_generation(&format!("{TRACE}\n OpStore %low %1\n {READS_LOW}")), writes(), 1.0, false)?;
    assert_eq!((counts(&stats, Stage::ClosestHit), words), ((3, 0, 3), [1, 0]));
    // Once more through a word that the shader does not write.
    let high = closest_hit("%value = OpLoad %uint %low\n OpStore %high %value");
    let (stats, words) =
        launch(ray_generation(&format!("OpStore %low %2\n {TRACE}\n {READS_LOW}")), high, 1.0, false)?;
    assert_eq!((counts(&stats, Stage::ClosestHit), words), ((3, 0, 3), [2, 0]));
    Ok(())
}

#[test]
fn the_same_goes_for_miss_shaders() -> Result<()> {
    let miss = || shader("MissKHR", "IncomingRayPayloadKHR", "OpStore %low %2");
    let (stats, _) = launch(ray_generation(TRACE), miss(), 0.0, false)?;
    assert_eq!(counts(&stats, Stage::Miss), (3, 0, 3));
    let (stats, words) = launch(ray_generation(&format!("{TRACE}\n {READS_LOW}")), miss(), 0.0, false)?;
    assert_eq!((counts(&stats, Stage::Miss), words), ((3, 1, 0), [2, 0]));
    Ok(())
}

#[test]
fn it_runs_where_its_payload_is_read() -> Result<()> {
    let writes = || closest_hit("OpStore %low %2");
    let reads = [
        // Behind the trace, in one branch only, and around a loop.
        format!("{TRACE}\n {READS_LOW}"),
        format!(
            "{TRACE}
             %invocation = OpLoad %uvec3 %id
             %x = OpCompositeExtract %uint %invocation 0
             %last = OpIEqual %bool %x %2
             OpSelectionMerge %merge None
             OpBranchConditional %last %then %merge
             %then = OpLabel
             {READS_LOW}
             OpBranch %merge
             %merge = OpLabel"
        ),
        format!(
            "OpBranch %head
             %head = OpLabel
             %round = OpPhi %uint %0 %start %more %continue
             OpLoopMerge %end %continue None
             OpBranch %body
             %body = OpLabel
             {READS_LOW}
             {TRACE}
             OpBranch %continue
             %continue = OpLabel
             %more = OpIAdd %uint %round %1
             %again = OpULessThan %bool %more %2
             OpBranchConditional %again %head %end
             %end = OpLabel"
        ),
    ];
    for body in reads {
        let (stats, words) = launch(ray_generation(&body), writes(), 1.0, false)?;
        let (_, batches, elided) = counts(&stats, Stage::ClosestHit);
        assert!(batches > 0 && elided == 0, "{body}: {stats:?}");
        assert_eq!(words[0], 2, "{body}");
    }
    // A second trace hands the payload to shaders that may read it; behind the second, nobody does.
    let again = TRACE.replace("%structure", "%again");
    let body = format!("{TRACE}\n {again}");
    let (stats, _) = launch(ray_generation(&body), writes(), 1.0, false)?;
    assert_eq!(counts(&stats, Stage::ClosestHit), (6, 1, 3));
    Ok(())
}

#[test]
fn a_payload_that_is_reached_by_a_computed_index_counts_as_read() {
    // The payload as an array, of which an element is read behind the trace whose number is
    // computed.
    let plain = ray_generation(TRACE);
    let op = |program: &Program| {
        let traces = |op: &anyhit_engine::ops::op::Op| matches!(op, anyhit_engine::ops::op::Op::Stop(_));
        OpIndex::new(program.ops.iter().position(traces).expect("a trace"))
    };
    let written = closest_hit("OpStore %low %2").payloads.writes_only.expect("nothing but the payload");
    assert!(!written.intersects(plain.payloads.read_after(op(&plain))));
    let body = format!(
        "{TRACE}
         %invocation = OpLoad %uvec3 %id
         %x = OpCompositeExtract %uint %invocation 0
         %element = OpAccessChain %part %payload %x
         %read = OpLoad %uint %element
         OpStore %first %read"
    );
    let computed = shader_with("OpTypeArray %uint %2", "RayGenerationKHR", "RayPayloadKHR", &body);
    assert!(written.intersects(computed.payloads.read_after(op(&computed))));
}

#[test]
fn it_runs_where_it_leaves_anything_else() -> Result<()> {
    let stores = "OpStore %low %2\n OpStore %second %1";
    let adds = "OpStore %low %2\n %old = OpAtomicIAdd %uint %second %1 %0 %1";
    for (body, left) in [(stores, 1), (adds, 3)] {
        let (stats, words) = launch(ray_generation(TRACE), closest_hit(body), 1.0, false)?;
        let (invocations, batches, elided) = counts(&stats, Stage::ClosestHit);
        assert!(invocations == 3 && batches > 0 && elided == 0, "{stats:?}");
        assert_eq!(words[1], left, "{body}");
    }
    let nothing_but = |body: &str| closest_hit(body).payloads.writes_only.is_some();
    assert!(nothing_but("OpStore %low %2"));
    let others = [
        // What is printed, what may trap, what runs other shaders, what may not end.
        "%said = OpExtInst %void %printf 1 %format",
        "%loaded = OpLoad %uint %first\n OpStore %low %loaded",
        "%structure = OpLoad %as %scene
         OpTraceRayKHR %structure %0 %255 %0 %0 %0 %origin %0f %down %9f %payload",
        "OpExecuteCallableKHR %0 %data",
        "OpBranch %head
         %head = OpLabel
         OpLoopMerge %end %continue None
         OpBranch %continue
         %continue = OpLabel
         %old = OpLoad %uint %low
         %more = OpIAdd %uint %old %1
         OpStore %low %more
         %again = OpULessThan %bool %more %2
         OpBranchConditional %again %head %end
         %end = OpLabel",
    ];
    for body in others {
        assert!(!nothing_but(body), "{body}");
    }
    Ok(())
}

#[test]
fn it_runs_where_somebody_watches() -> Result<()> {
    let (stats, _) = launch(ray_generation(TRACE), closest_hit("OpStore %low %2"), 1.0, true)?;
    assert_eq!(counts(&stats, Stage::ClosestHit), (3, 1, 0));
    Ok(())
}
