//! Explicit layouts: verdicts against those of `spirv-val`, which `layouts/recorded.txt` records,
//! and rules that it does not know, each with its section.

use std::path::Path;
use std::sync::Arc;

use anyhit::{DeviceProfile, Error, ErrorKind, Module};
use anyhit_engine::module::{
    self,
    validate::{explicit_layout::LayoutFeatures, layout::layout_faults},
};
use anyhit_engine::program;

use crate::support::assembly::assemble;

/// The features of each column of the record.
const COLUMNS: [LayoutFeatures; 3] = [
    LayoutFeatures::ALL,
    LayoutFeatures { scalar_block_layout: false, uniform_buffer_standard_layout: true },
    LayoutFeatures { scalar_block_layout: false, uniform_buffer_standard_layout: false },
];

/// A compute shader with a variable `%v` whose block is `%S`, and what its body adds.
fn compute(class: &str, decorations: &str, types: &str) -> Module {
    module_of(class, "GLCompute", decorations, types, "")
}

fn module_of(class: &str, stage: &str, decorations: &str, types: &str, body: &str) -> Module {
    let mode = if stage == "GLCompute" { "OpExecutionMode %main LocalSize 1 1 1" } else { "" };
    let text = format!(
        "OpCapability Shader
         OpCapability RayTracingKHR
         OpCapability PhysicalStorageBufferAddresses
         OpCapability Int64
         OpExtension \"SPV_KHR_ray_tracing\"
         OpExtension \"SPV_KHR_physical_storage_buffer\"
         OpMemoryModel PhysicalStorageBuffer64 GLSL450
         OpEntryPoint {stage} %main \"main\" %v
         {mode}
         OpName %S \"S\"
         OpDecorate %S Block
         {decorations}
         OpDecorate %v DescriptorSet 0
         OpDecorate %v Binding 0
         %void = OpTypeVoid
         %fn = OpTypeFunction %void
         %float = OpTypeFloat 32
         %uint = OpTypeInt 32 0
         %u2 = OpConstant %uint 2
         %u3 = OpConstant %uint 3
         %v2 = OpTypeVector %float 2
         %v3 = OpTypeVector %float 3
         %v4 = OpTypeVector %float 4
         %m3 = OpTypeMatrix %v3 3
         %m2x3 = OpTypeMatrix %v3 2
         {types}
         %p = OpTypePointer {class} %S
         %v = OpVariable %p {class}
         %main = OpFunction %void None %fn
         %entry = OpLabel
         {body}
         OpReturn
         OpFunctionEnd"
    );
    module::load(&assemble(&text)).unwrap_or_else(|error| panic!("{text}\n{}", error.render()))
}

/// The error of lowering the entry point of a module.
fn error(module: Module) -> Option<Error> {
    let module = Arc::new(module);
    program::lower(&module, &module.entry_points[0]).err()
}

/// The report of a module that lowering must call invalid.
fn invalid(module: Module) -> String {
    let error = error(module).expect("an error");
    assert_eq!(error.kind(), ErrorKind::InvalidModule, "{}", error.render());
    error.render()
}

fn is_valid(module: &Module, features: LayoutFeatures) -> bool {
    layout_faults(module, features, &|id| module.scalar_value(id)).is_empty()
}

#[test]
fn verdicts_are_those_of_the_validator() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/modules/layouts/recorded.txt");
    let text = std::fs::read_to_string(path).expect("the record").replace("\r\n", "\n");
    let mut wrong = Vec::new();
    let mut judged = 0;
    for case in text.split("\n# ").skip(1) {
        let mut lines = case.lines().filter(|line| !line.is_empty());
        let name = lines.next().expect("a name");
        let verdicts: Vec<&str> = lines.next().expect("verdicts").split_whitespace().skip(1).collect();
        let (decorations, types): (Vec<&str>, Vec<&str>) = lines.partition(|line| !line.starts_with('%'));
        for pair in verdicts.chunks_exact(2) {
            let module = compute(pair[0], &decorations.join("\n"), &types.join("\n"));
            for (column, features) in COLUMNS.into_iter().enumerate() {
                judged += 1;
                let expected = pair[1].as_bytes()[column] == b'v';
                if is_valid(&module, features) != expected {
                    wrong.push(format!("{name}, {}, column {column}: expected valid: {expected}", pair[0]));
                }
            }
        }
    }
    assert!(judged > 400, "{judged}");
    assert!(wrong.is_empty(), "{} of {judged}:\n{}", wrong.len(), wrong.join("\n"));
}

/// `spirv-val` accepts it: "The ArrayStride, MatrixStride, and Offset decorations must be large
/// enough to hold the size of the objects they affect [...] Each ArrayStride and MatrixStride must
/// be greater than zero" (SPIR-V, 2.16.2).
#[test]
fn columns_of_a_matrix_do_not_overlap() {
    for (order, stride, is_fine) in [
        ("ColMajor", 0, false),
        ("ColMajor", 4, false),
        ("ColMajor", 12, true),
        ("RowMajor", 4, false),
        ("RowMajor", 8, true),
    ] {
        let decorations = format!(
            "OpMemberDecorate %S 0 Offset 0\nOpMemberDecorate %S 0 {order}\nOpMemberDecorate %S 0 MatrixStride {stride}"
        );
        let module = compute("StorageBuffer", &decorations, "%S = OpTypeStruct %m2x3");
        assert_eq!(is_valid(&module, LayoutFeatures::ALL), is_fine, "{order} {stride}");
        if !is_fine {
            let text = invalid(module);
            assert!(
                text.contains("SPIR-V, 2.16.2") && text.contains(&format!("MatrixStride {stride}")),
                "{text}"
            );
        }
    }
}

/// Vulkan, "Offset and Stride Assignment", names ShaderRecordBufferKHR and PhysicalStorageBuffer
/// with the other storage classes; `spirv-val` does not look at the former.
#[test]
fn records_and_device_addresses_obey_the_same_rules() {
    let array = "%a = OpTypeArray %float %u3\n%S = OpTypeStruct %a";
    let stride = |stride| format!("OpMemberDecorate %S 0 Offset 0\nOpDecorate %a ArrayStride {stride}");
    let record = |stride_bytes| {
        module_of(
            "ShaderRecordBufferKHR",
            "MissKHR",
            &stride(stride_bytes),
            array,
            "%x = OpAccessChain %p %v",
        )
    };
    assert!(error(record(4)).is_none());
    assert!(invalid(record(0)).contains("`S` has an array with ArrayStride 0"));
    let address = |second: &str| {
        let decorations = format!(
            "OpDecorate %T Block\nOpMemberDecorate %T 0 Offset 0\n{second}\nOpMemberDecorate %S 0 Offset 0"
        );
        let types = "%T = OpTypeStruct %v3 %float\n%pT = OpTypePointer PhysicalStorageBuffer %T\n\
                     %S = OpTypeStruct %pT\n%ppT = OpTypePointer StorageBuffer %pT\n%zero = OpConstant %uint 0";
        let body = "%at = OpAccessChain %ppT %v %zero\n%address = OpLoad %pT %at";
        module_of("StorageBuffer", "GLCompute", &decorations, types, body)
    };
    assert!(error(address("OpMemberDecorate %T 1 Offset 12")).is_none());
    let text = invalid(address("OpMemberDecorate %T 1 Offset 8"));
    assert!(text.contains("at offset 8 overlaps member 0 of `%"), "{text}");
    let text = invalid(address(""));
    assert!(text.contains("member 1 of `%") && text.contains("has no Offset"), "{text}");
}

/// VUID-StandaloneSpirv-Input-07290: a bool that enters or leaves a shader is a builtin.
#[test]
fn a_bool_in_the_interface_is_a_builtin() {
    let interface = |decoration: &str| {
        let types = "%S = OpTypeStruct %float\n%bool = OpTypeBool\n%pb = OpTypePointer Input %bool\n\
                     %flag = OpVariable %pb Input";
        let decorations = format!("OpMemberDecorate %S 0 Offset 0\n{decoration}");
        module_of("StorageBuffer", "ClosestHitKHR", &decorations, types, "%set = OpLoad %bool %flag")
    };
    assert!(is_valid(&interface("OpDecorate %flag BuiltIn HitIsSphereNV"), LayoutFeatures::ALL));
    assert!(!is_valid(&interface("OpDecorate %flag Location 0"), LayoutFeatures::ALL));
}

/// Lengths of arrays are specialization constants, alone and in a computed constant: a module is
/// judged by the values that it has when it is lowered.
#[test]
fn lengths_count_after_specialization() {
    let decorations = "OpMemberDecorate %S 0 Offset 0\nOpMemberDecorate %S 1 Offset 16\nOpDecorate %a ArrayStride 4\n\
                       OpDecorate %n SpecId 7\nOpName %n \"BINS\"\nOpMemberName %S 0 \"count\"\n\
                       OpMemberName %S 1 \"total\"";
    let types = "%n = OpSpecConstant %uint 4\n%a = OpTypeArray %float %n\n%S = OpTypeStruct %a %float";
    let mut module = compute("StorageBuffer", decorations, types);
    assert!(error(module.clone()).is_none());
    module.specialize(7, 5).expect("a constant");
    let text = invalid(module.clone());
    let wanted = "`S.total` at offset 16 overlaps `S.count`, which ends at offset 20: its length is the \
                  specialization constant `BINS`, constant_id 7: 5";
    assert!(text.contains(wanted), "{text}");
    module.specialize(7, 1).expect("a constant");
    assert!(error(module).is_none());

    let computed = "%n = OpSpecConstant %uint 2\n%twice = OpSpecConstantOp %uint IMul %n %u2\n\
                    %a = OpTypeArray %float %twice\n%S = OpTypeStruct %a %float";
    let mut module = compute("StorageBuffer", decorations, computed);
    assert!(error(module.clone()).is_none());
    module.specialize(7, 3).expect("a constant");
    let text = invalid(module);
    assert!(text.contains("`S.total` at offset 16 overlaps `S.count`, which ends at offset 24"), "{text}");
}

/// A vec3 at offset 8 straddles a boundary of 16 bytes (Vulkan, "Offset and Stride Assignment").
#[test]
fn a_device_without_scalar_layouts_refuses_dense_blocks() {
    let offsets = |second| format!("OpMemberDecorate %S 0 Offset 0\nOpMemberDecorate %S 1 Offset {second}");
    let block = |second| compute("StorageBuffer", &offsets(second), "%S = OpTypeStruct %float %v3");
    let device = DeviceProfile::default().with_feature("ray_query", false).expect("a feature");
    assert!(device.check_module(&block(8)).is_ok());
    let device = device.with_feature("scalar_block_layout", false).expect("a feature");
    assert!(device.check_module(&block(16)).is_ok());
    let error = device.check_module(&block(8)).expect_err("it straddles");
    assert_eq!(error.kind(), ErrorKind::InvalidModule);
    let text = error.render();
    for part in
        ["on the device `permissive`", "at offset 8 straddles a boundary of 16 bytes", "scalarBlockLayout"]
    {
        assert!(text.contains(part), "{text}");
    }
}

/// Structs of structs of structs are visited once each.
#[test]
fn deep_layouts_take_no_time() {
    let mut decorations = String::from("OpMemberDecorate %S 0 Offset 0\n");
    let mut types = String::from("%s0 = OpTypeStruct %float %float\n");
    decorations += "OpMemberDecorate %s0 0 Offset 0\nOpMemberDecorate %s0 1 Offset 4\n";
    for depth in 1..18 {
        let inner = depth - 1;
        types += &format!("%s{depth} = OpTypeStruct %s{inner} %s{inner}\n");
        let size = 8_u32 << inner;
        decorations +=
            &format!("OpMemberDecorate %s{depth} 0 Offset 0\nOpMemberDecorate %s{depth} 1 Offset {size}\n");
    }
    types += "%S = OpTypeStruct %s17";
    let module = compute("StorageBuffer", &decorations, &types);
    for features in COLUMNS {
        assert!(is_valid(&module, LayoutFeatures { uniform_buffer_standard_layout: true, ..features }));
    }
}
