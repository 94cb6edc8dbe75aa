//! Ray queries and hit objects where no compiler would write them so.

use anyhit_base::error::ErrorKind;

use crate::execution::instructions::run::Shader;

/// The prelude of a shader with ray queries through a null acceleration structure.
fn shader<'a>(declarations: &'a str, body: &'a str, functions: &'a str) -> Shader<'a> {
    Shader {
        capabilities: "
            OpCapability RayQueryKHR
            OpCapability RayTracingPositionFetchKHR
            OpCapability ShaderInvocationReorderEXT",
        declarations,
        body,
        functions,
        ..Shader::default()
    }
}

const TYPES: &str = "
    %query_type = OpTypeRayQueryKHR
    %structure_type = OpTypeAccelerationStructureKHR
    %f0 = OpConstant %float 0.0
    %f1 = OpConstant %float 1.0
    %zero3 = OpConstantComposite %float3 %f0 %f0 %f0
    %ones3 = OpConstantComposite %float3 %f1 %f1 %f1
    %null = OpConstantNull %ulong
    %ptr_Function_query = OpTypePointer Function %query_type
    %ptr_Private_query = OpTypePointer Private %query_type
    %shared_query = OpVariable %ptr_Private_query Private
";

#[test]
fn a_query_of_a_function_begins_anew_with_each_call() {
    let declarations = format!("{TYPES}\n%type = OpTypeFunction %bool %bool");
    let functions = "
        %once = OpFunction %bool None %type
        %first = OpFunctionParameter %bool
        %once_entry = OpLabel
        %own = OpVariable %ptr_Function_query Function
        OpSelectionMerge %once_merge None
        OpBranchConditional %first %once_begin %once_merge
        %once_begin = OpLabel
        %tlas = OpConvertUToAccelerationStructureKHR %structure_type %null
        OpRayQueryInitializeKHR %own %tlas %u0 %u1 %zero3 %f0 %ones3 %f1
        OpBranch %once_merge
        %once_merge = OpLabel
        %more = OpRayQueryProceedKHR %bool %own
        OpReturnValue %more
        OpFunctionEnd";
    let body = "
        %a = OpFunctionCall %bool %once %true
        %b = OpFunctionCall %bool %once %false";
    let error = shader(&declarations, body, functions).refused();
    assert_eq!(error.kind(), ErrorKind::Trap);
    assert!(error.message().contains("before OpRayQueryInitializeKHR"), "{}", error.render());
    // Once with each call it runs: a null structure has nothing to show.
    let body = "
        %a = OpFunctionCall %bool %once %true
        %b = OpFunctionCall %bool %once %true
        %both = OpLogicalOr %bool %a %b
        %word = OpSelect %uint %both %u1 %u2
        out 0 %word";
    assert!(shader(&declarations, body, functions).run().iter().all(|words| words[0] == 2));
}

#[test]
fn invocations_that_part_have_queries_of_their_own() {
    let body = "
        %tlas = OpConvertUToAccelerationStructureKHR %structure_type %null
        %low = OpBitwiseAnd %uint %id %u1
        %odd = OpIEqual %bool %low %u1
        OpSelectionMerge %merge None
        OpBranchConditional %odd %then %other
        %then = OpLabel
        OpRayQueryInitializeKHR %shared_query %tlas %u1 %u1 %zero3 %f0 %ones3 %f1
        OpBranch %merge
        %other = OpLabel
        OpRayQueryInitializeKHR %shared_query %tlas %u16 %u1 %zero3 %f0 %ones3 %f1
        OpBranch %merge
        %merge = OpLabel
        %flags = OpRayQueryGetRayFlagsKHR %uint %shared_query
        out 0 %flags";
    for (id, words) in shader(TYPES, body, "").run().iter().enumerate() {
        assert_eq!(words[0], if id % 2 == 1 { 1 } else { 16 });
    }
}

#[test]
fn what_breaks_a_rule_is_refused_before_it_runs() {
    let rows = [
        ("%a = OpRayQueryGetIntersectionTypeKHR %uint %shared_query %id", "must be a constant"),
        ("%a = OpRayQueryGetIntersectionTypeKHR %uint %shared_query %u2", "the operand Intersection is 2"),
        (
            "%a = OpRayQueryGetRayTMinKHR %uint %shared_query",
            "the result of OpRayQueryGetRayTMinKHR must be a 32-bit float",
        ),
        ("%a = OpRayQueryProceedKHR %uint %shared_query", "must be a bool"),
        ("%a = OpLoad %query_type %shared_query", "cannot be loaded"),
        ("OpCopyMemory %shared_query %shared_query", "cannot be loaded"),
        ("OpRayQueryTerminateKHR %out", "which this instruction does not accept"),
        ("OpRayQueryGenerateIntersectionKHR %shared_query %zero3", "a hit distance must be a 32-bit float"),
        ("OpHitObjectRecordEmptyEXT %shared_query", "which this instruction does not accept"),
    ];
    for (body, expected) in rows {
        let error = shader(TYPES, body, "").refused();
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{body}: {}", error.render());
        assert!(error.message().contains(expected), "{body}: {}", error.render());
    }
}

#[test]
fn a_miss_is_recorded_with_its_time() {
    let declarations = format!(
        "{TYPES}\n%object_type = OpTypeHitObjectEXT\n%ptr_Private_object = OpTypePointer Private %object_type\n%object = OpVariable %ptr_Private_object Private"
    );
    let body = "
        OpHitObjectRecordMissMotionEXT %object %u0 %u0 %zero3 %f0 %ones3 %f1 %f1
        %time = OpHitObjectGetCurrentTimeEXT %float %object
        %bits = OpBitcast %uint %time
        out 0 %bits";
    let found = shader(&declarations, body, "").run();
    assert!(found.iter().all(|words| words[0] == 1f32.to_bits()));
}

#[test]
fn an_undefined_structure_is_missed_and_a_null_query_traps() {
    let declarations = format!("{TYPES}\n%null_query = OpConstantNull %ptr_Private_query");
    let body = "
        %none = OpUndef %structure_type
        OpRayQueryInitializeKHR %shared_query %none %u0 %u1 %zero3 %f0 %ones3 %f1
        %more = OpRayQueryProceedKHR %bool %shared_query
        %word = OpSelect %uint %more %u1 %u2
        out 0 %word";
    assert!(shader(&declarations, body, "").run().iter().all(|words| words[0] == 2));
    for body in [
        "%more = OpRayQueryProceedKHR %bool %null_query",
        "%tlas = OpConvertUToAccelerationStructureKHR %structure_type %null
         OpRayQueryInitializeKHR %null_query %tlas %u0 %u1 %zero3 %f0 %ones3 %f1",
    ] {
        let error = shader(&declarations, body, "").refused();
        assert_eq!(error.message(), "an access through a null pointer", "{}", error.render());
    }
}

/// "OpTypeRayQueryKHR": its variables are in `Private` or `Function` storage, without an
/// initializer, and what points to them is no value to choose from.
#[test]
fn queries_are_variables_of_the_invocation_alone() {
    let declared = |more: &str| format!("{TYPES}\n{more}");
    let initialize = |query: &str| {
        format!(
            "%tlas = OpConvertUToAccelerationStructureKHR %structure_type %null
             OpRayQueryInitializeKHR {query} %tlas %u0 %u1 %zero3 %f0 %ones3 %f1"
        )
    };
    let other = "%other_query = OpVariable %ptr_Private_query Private";
    let runs = |declarations: &str, body: &str| {
        let shader = shader(declarations, body, "");
        shader.run_with(&mut Default::default).map(|_| ())
    };
    assert!(runs(&declared(other), &initialize("%other_query")).is_ok());
    let of_class = |class: &str| {
        format!("%ptr_query = OpTypePointer {class} %query_type\n%elsewhere = OpVariable %ptr_query {class}")
    };
    let choices = declared(other);
    let branch = "OpSelectionMerge %merge None
        OpBranchConditional %true %then %merge
        %then = OpLabel
        OpBranch %merge
        %merge = OpLabel
        %chosen = OpPhi %ptr_Private_query %shared_query %entry %other_query %then";
    let select = "%chosen = OpSelect %ptr_Private_query %true %shared_query %other_query";
    for (what, declarations, body) in [
        ("Workgroup", declared(&of_class("Workgroup")), initialize("%elsewhere")),
        ("RayPayloadKHR", declared(&of_class("RayPayloadKHR")), initialize("%elsewhere")),
        (
            "an initializer",
            declared(
                "%nothing = OpConstantNull %query_type
                 %filled = OpVariable %ptr_Private_query Private %nothing",
            ),
            initialize("%filled"),
        ),
        (
            "an undefined initializer",
            declared(
                "%nothing = OpUndef %query_type
                 %filled = OpVariable %ptr_Private_query Private %nothing",
            ),
            initialize("%filled"),
        ),
        ("a phi", choices.clone(), format!("{branch}\n{}", initialize("%chosen"))),
        ("a select", choices.clone(), format!("{select}\n{}", initialize("%chosen"))),
    ] {
        let error = runs(&declarations, &body).expect_err(what);
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{what}: {}", error.render());
    }
}
