//! Calls of `SPV_NV_ray_tracing`, which name their data by its location.

use crate::execution::instructions::run::Shader;

#[test]
fn callable_data_is_found_by_its_location() {
    let found = Shader {
        annotations: "
            OpEntryPoint CallableKHR %callee \"callee\"
            OpDecorate %other Location 0
            OpDecorate %data Location 5",
        declarations: "
            %ptr_CallableData_uint = OpTypePointer CallableDataKHR %uint
            %other = OpVariable %ptr_CallableData_uint CallableDataKHR
            %data = OpVariable %ptr_CallableData_uint CallableDataKHR
            %ptr_Incoming_uint = OpTypePointer IncomingCallableDataKHR %uint
            %incoming = OpVariable %ptr_Incoming_uint IncomingCallableDataKHR",
        body: "
            OpStore %other %u9
            OpStore %data %id
            OpExecuteCallableNV %u0 %u5
            %result = OpLoad %uint %data
            out 0 %result
            %kept = OpLoad %uint %other
            out 1 %kept",
        functions: "
            %callee = OpFunction %void None %main_type
            %callee_entry = OpLabel
            %value = OpLoad %uint %incoming
            %doubled = OpIMul %uint %value %u2
            OpStore %incoming %doubled
            OpReturn
            OpFunctionEnd",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[..2], [2 * id as u32, 9]);
    }
}

/// A variable that a function doubles through a pointer, as often as it is called: each call loads
/// what the one before it stored.
#[test]
fn a_function_doubles_what_a_pointer_leads_to_with_each_call() {
    let found = Shader {
        declarations: "%double_type = OpTypeFunction %void %ptr_Function_uint",
        body: "
            %variable = OpVariable %ptr_Function_uint Function
            %begin = OpIAdd %uint %id %u1
            OpStore %variable %begin
            %first = OpFunctionCall %void %twofold %variable
            %second = OpFunctionCall %void %twofold %variable
            %twice = OpLoad %uint %variable
            out 0 %twice
            %third = OpFunctionCall %void %twofold %variable
            %thrice = OpLoad %uint %variable
            out 1 %thrice",
        functions: "
            %twofold = OpFunction %void None %double_type
            %pointer = OpFunctionParameter %ptr_Function_uint
            %double_entry = OpLabel
            %a = OpLoad %uint %pointer
            %b = OpLoad %uint %pointer
            %sum = OpIAdd %uint %a %b
            OpStore %pointer %sum
            OpReturn
            OpFunctionEnd",
        ..Shader::default()
    }
    .run();
    for (id, words) in (1..).zip(&found) {
        assert_eq!(words[..2], [4 * id, 8 * id]);
    }
}

/// `SPV_KHR_ray_tracing`, OpExecuteCallableKHR: the data is the result of an OpVariable.
#[test]
fn callable_data_is_a_whole_variable() {
    let error = Shader {
        declarations: "
            %pair = OpTypeStruct %uint %uint
            %ptr_CallableData_pair = OpTypePointer CallableDataKHR %pair
            %ptr_CallableData_uint = OpTypePointer CallableDataKHR %uint
            %data = OpVariable %ptr_CallableData_pair CallableDataKHR",
        body: "
            %second = OpAccessChain %ptr_CallableData_uint %data %u1
            OpExecuteCallableKHR %u0 %second",
        ..Shader::default()
    }
    .refused();
    assert!(error.message().contains("is not a variable: the operand must be a whole variable"), "{error}");
}

/// `SPV_NV_shader_invocation_reorder` and `SPV_KHR_ray_query`: operands are words and floats of 32
/// bits, and a hint comes with its number of bits.
#[test]
fn operands_of_reorderings_and_queries_have_32_bits() {
    for (body, wanted) in [
        ("OpReorderThreadWithHintNV %number %u1", "operand 1 of OpReorderThreadWithHintNV is of type float"),
        ("OpReorderThreadWithHitObjectNV %object %u1", "has a hint, but no number of bits"),
        (
            "OpReorderThreadWithHitObjectNV %object %u1 %wide",
            "operand 3 of OpReorderThreadWithHitObjectNV is of type uint64_t",
        ),
        (
            "OpHitObjectRecordMissNV %object %number %at %number %at %number",
            "operand 2 of OpHitObjectRecordMissNV is of type float",
        ),
        (
            "%kind = OpRayQueryGetIntersectionTypeKHR %uint %query %wide",
            "the operand Intersection is not a 32-bit integer",
        ),
    ] {
        let error = Shader {
            capabilities: "OpCapability ShaderInvocationReorderNV\nOpCapability RayQueryKHR",
            declarations: "
                %object_type = OpTypeHitObjectNV
                %query_type = OpTypeRayQueryKHR
                %ptr_object = OpTypePointer Private %object_type
                %ptr_query = OpTypePointer Private %query_type
                %object = OpVariable %ptr_object Private
                %query = OpVariable %ptr_query Private
                %number = OpConstant %float 0.5
                %at = OpConstantComposite %float3 %number %number %number
                %wide = OpConstant %ulong 1L",
            body,
            ..Shader::default()
        }
        .refused();
        assert!(error.message().contains(wanted), "{body}: {error}");
    }
}
