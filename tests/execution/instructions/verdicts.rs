//! Whose mistake a refused module is: a broken rule is cited, where the validator of SPIRV-Tools
//! does not check it; what no rule forbids is this crate's gap.

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::Resources;

use crate::execution::instructions::run::Shader;

/// Kind and first note of the error of a shader that is refused.
fn verdict(shader: &Shader<'_>) -> (ErrorKind, Option<String>) {
    let error = shader.refused();
    (error.kind(), error.notes().first().cloned())
}

#[test]
fn a_cluster_that_is_no_power_of_two_breaks_no_rule() {
    // "Behavior is undefined unless ClusterSize is at least 1 and a power of 2."
    let shader = Shader {
        capabilities: "OpCapability GroupNonUniformArithmetic\nOpCapability GroupNonUniformClustered",
        body: "%sum = OpGroupNonUniformIAdd %uint %u3 ClusteredReduce %id %u3\nout 0 %sum",
        ..Shader::default()
    };
    assert_eq!(verdict(&shader).0, ErrorKind::UnsupportedModule);
}

/// SPIR-V, 3.3.17: "This instruction is only valid in the Fragment Execution Model."
#[test]
fn what_ends_a_fragment_is_invalid_elsewhere() {
    for name in ["OpKill", "OpTerminateInvocation"] {
        let body = format!("{name}\n%behind = OpLabel");
        let (kind, note) = verdict(&Shader { body: &body, ..Shader::default() });
        assert_eq!(kind, ErrorKind::InvalidModule);
        assert!(note.is_some_and(|note| note.starts_with(&format!("SPIR-V, 3.3.17, {name}"))));
    }
}

/// `spirv-val`: "Instruction may not have a logical pointer operand".
#[test]
fn logical_pointers_are_no_numbers() {
    for body in ["%x = OpBitcast %uint %out", "%x = OpBitcast %ptr_StorageBuffer_uint %u1"] {
        let (kind, note) = verdict(&Shader { body, ..Shader::default() });
        assert_eq!(kind, ErrorKind::InvalidModule);
        assert!(note.is_some_and(|note| note.starts_with("SPIR-V, 2.16.1")), "{body}");
    }
}

#[test]
fn ray_queries_are_not_loaded() {
    let shader = Shader {
        capabilities: "OpCapability RayQueryKHR",
        declarations: "%query_type = OpTypeRayQueryKHR
            %ptr_query = OpTypePointer Private %query_type
            %query = OpVariable %ptr_query Private",
        body: "%value = OpLoad %query_type %query",
        ..Shader::default()
    };
    let (kind, note) = verdict(&shader);
    assert_eq!(kind, ErrorKind::InvalidModule);
    // Its change of OpLoad: "Pointer must not be OpTypeRayQueryKHR".
    assert!(note.is_some_and(|note| note.starts_with("SPV_KHR_ray_query")));
}

#[test]
fn hit_objects_are_variables_that_are_not_loaded() {
    let of = |class: &str, body: &str| {
        let declarations = format!(
            "%object_type = OpTypeHitObjectEXT
             %ptr_object = OpTypePointer {class} %object_type
             %object = OpVariable %ptr_object {class}"
        );
        let shader = Shader {
            capabilities: "OpCapability ShaderInvocationReorderEXT",
            declarations: &declarations,
            body,
            ..Shader::default()
        };
        shader.run_with(&mut Resources::default).map_err(|error| (error.kind(), error.message().to_owned()))
    };
    let record = "OpHitObjectRecordEmptyEXT %object";
    assert!(of("Private", record).is_ok());
    for (class, body, words) in [
        ("Private", "%value = OpLoad %object_type %object", "cannot be loaded"),
        ("Private", "OpCopyMemory %object %object", "cannot be loaded"),
        ("Workgroup", record, "which must be Function or Private"),
    ] {
        let (kind, message) = of(class, body).unwrap_err();
        assert_eq!(kind, ErrorKind::InvalidModule, "{class}: {body}: {message}");
        assert!(message.contains(words), "{class}: {body}: {message}");
    }
}

#[test]
fn a_barrier_of_a_ray_tracing_shader_is_of_its_subgroup() {
    let of_scope = |body| Shader { body, ..Shader::default() };
    for (body, rule) in [
        ("OpControlBarrier %u2 %u2 %u0", "VUID-StandaloneSpirv-None-04637"),
        ("OpControlBarrier %u1 %u1 %u0", "VUID-StandaloneSpirv-None-04636"),
    ] {
        assert_eq!(verdict(&of_scope(body)), (ErrorKind::InvalidModule, Some(rule.to_owned())), "{body}");
    }
    assert!(of_scope("OpControlBarrier %u3 %u3 %u0").run_with(&mut Resources::default).is_ok());
}

#[test]
fn buffers_must_be_laid_out_and_shader_records_should() {
    let of_class = |class: &str| {
        let declarations = format!(
            "%bare = OpTypeStruct %uint
             %ptr_bare = OpTypePointer {class} %bare
             %ptr_member = OpTypePointer {class} %uint
             %buffer = OpVariable %ptr_bare {class}"
        );
        let shader = Shader {
            annotations: "OpDecorate %bare Block
                OpDecorate %buffer DescriptorSet 0
                OpDecorate %buffer Binding 1",
            declarations: &declarations,
            body: "%member = OpAccessChain %ptr_member %buffer %u0\n%value = OpLoad %uint %member",
            ..Shader::default()
        };
        verdict(&shader)
    };
    // Section 2.16.2 names the storage classes; no rule was found for the records.
    for class in ["StorageBuffer", "Uniform", "PushConstant"] {
        let (kind, note) = of_class(class);
        assert_eq!(kind, ErrorKind::InvalidModule, "{class}");
        assert!(note.is_some_and(|note| note.contains("SPIR-V, 2.16.2")), "{class}");
    }
    assert_eq!(of_class("ShaderRecordBufferKHR"), (ErrorKind::UnsupportedModule, None));
}

#[test]
fn a_print_without_a_string_names_its_instruction_set() {
    let shader = Shader { body: "%a = OpExtInst %void %printf 1 %u0", ..Shader::default() };
    let wanted = Some("NonSemantic.DebugPrintf, Format".to_owned());
    assert_eq!(verdict(&shader), (ErrorKind::InvalidModule, wanted));
}

#[test]
fn nothing_is_stored_to_shader_records_and_push_constants() {
    // spirv-val: "ShaderRecordBufferKHR Storage Class variables are read only", "storage class is
    // read-only".
    for class in ["ShaderRecordBufferKHR", "PushConstant"] {
        let declarations = format!(
            "%bare = OpTypeStruct %uint
             %ptr_bare = OpTypePointer {class} %bare
             %ptr_member = OpTypePointer {class} %uint
             %buffer = OpVariable %ptr_bare {class}"
        );
        let shader = Shader {
            annotations: "OpDecorate %bare Block\nOpMemberDecorate %bare 0 Offset 0",
            declarations: &declarations,
            body: "%member = OpAccessChain %ptr_member %buffer %u0\nOpStore %member %u1",
            ..Shader::default()
        };
        assert_eq!(verdict(&shader).0, ErrorKind::InvalidModule, "{class}");
    }
}

/// SPIR-V 3.3.10, OpImageQuerySize: one component for 1D and Buffer, two for 2D, Cube and Rect,
/// three for 3D, and one more for arrays.
#[test]
fn the_size_of_an_image_has_as_many_components_as_the_image_has_dimensions() {
    let query = |image: &str, components: usize| {
        let declarations = format!(
            "%image_type = OpTypeImage %uint {image} 2 R32ui
             %ptr_image = OpTypePointer UniformConstant %image_type
             %image = OpVariable %ptr_image UniformConstant"
        );
        let ty = ["%uint", "%uint2", "%uint3", "%uint4"][components - 1];
        let body = format!("%i = OpLoad %image_type %image\n%size = OpImageQuerySize {ty} %i");
        let shader = Shader {
            capabilities: "OpCapability ImageQuery\nOpCapability Image1D",
            annotations: "OpDecorate %image DescriptorSet 0\nOpDecorate %image Binding 9",
            declarations: &declarations,
            body: &body,
            ..Shader::default()
        };
        shader.run_with(&mut Resources::default).map_err(|error| error.kind())
    };
    for (image, expected) in
        [("1D 0 0 0", 1), ("1D 0 1 0", 2), ("2D 0 0 0", 2), ("2D 0 1 0", 3), ("3D 0 0 0", 3)]
    {
        for components in 1..=4 {
            let found = query(image, components);
            assert_eq!(found == Err(ErrorKind::InvalidModule), components != expected, "{image}: {found:?}");
        }
    }
}
