//! Builtins that no shader of `shaders/` reads.

use anyhit_engine::machine::{Buffer, Descriptor, Resources};

use crate::execution::instructions::run::Shader;
use crate::execution::instructions::workgroup::Workgroup;

/// Runs a shader that writes the words of input variables, given as (builtin, type, words).
fn read(capabilities: &str, builtins: &[(&str, &str, u32)]) -> Vec<[u32; 16]> {
    let (mut annotations, mut declarations, mut body) = (String::new(), String::new(), String::new());
    let mut at = 0;
    for (builtin, ty, words) in builtins {
        annotations += &format!("OpDecorate %in_{builtin} BuiltIn {builtin}\n");
        declarations += &format!("%in_{builtin} = OpVariable %ptr_Input_{ty} Input\n");
        body += &format!("%value_{builtin} = OpLoad %{ty} %in_{builtin}\n");
        for word in 0..*words {
            let value = if *words == 1 {
                format!("%value_{builtin}")
            } else {
                body += &format!("%w_{at} = OpCompositeExtract %uint %value_{builtin} {word}\n");
                format!("%w_{at}")
            };
            body += &format!("out {at} {value}\n");
            at += 1;
        }
    }
    let types =
        "%ptr_Input_uint = OpTypePointer Input %uint\n%ptr_Input_uint4 = OpTypePointer Input %uint4\n";
    let declarations = format!("{types}{declarations}");
    let shader = Shader {
        capabilities,
        annotations: &annotations,
        declarations: &declarations,
        body: &body,
        ..Shader::default()
    };
    shader.run()
}

#[test]
fn one_device_with_one_core_of_one_warp() {
    let builtins = [
        ("DeviceIndex", "uint", 1),
        ("WarpsPerSMNV", "uint", 1),
        ("SMCountNV", "uint", 1),
        ("WarpIDNV", "uint", 1),
        ("SMIDNV", "uint", 1),
        ("CoreIDARM", "uint", 1),
        ("CoreCountARM", "uint", 1),
        ("CoreMaxIDARM", "uint", 1),
        ("WarpIDARM", "uint", 1),
        ("WarpMaxIDARM", "uint", 1),
    ];
    let capabilities = "
        OpCapability DeviceGroup
        OpCapability ShaderSMBuiltinsNV
        OpCapability CoreBuiltinsARM";
    for words in read(capabilities, &builtins) {
        // Counts are 1, numbers and greatest numbers 0.
        assert_eq!(words[..10], [0, 1, 1, 0, 0, 0, 1, 0, 0, 0]);
    }
}

#[test]
fn masks_of_the_subgroup() {
    let masks = ["SubgroupEqMask", "SubgroupGeMask", "SubgroupGtMask"].map(|name| (name, "uint4", 4));
    let rest = ["SubgroupLeMask", "SubgroupLtMask"].map(|name| (name, "uint4", 4));
    let capability = "OpCapability GroupNonUniformBallot";
    let found = read(capability, &masks).into_iter().zip(read(capability, &rest));
    for (id, (first, second)) in found.enumerate() {
        let (place, size) = (id as u32 % 32, if id < 32 { 32 } else { 8 });
        let mask = |holds: &dyn Fn(u32) -> bool| -> u32 {
            (0..32).filter(|&other| holds(other)).map(|other| 1 << other).sum()
        };
        assert_eq!(first[0], mask(&|other| other == place));
        // Bits above the own place reach to the size of a subgroup, which is 32 whatever its
        // members.
        assert_eq!(first[4], mask(&|other| other >= place), "{id} of {size}");
        assert_eq!(first[8], mask(&|other| other > place));
        assert_eq!(second[0], mask(&|other| other <= place));
        assert_eq!(second[4], mask(&|other| other < place));
        for high in [&first[1..4], &first[5..8], &first[9..12], &second[1..4], &second[5..8]] {
            assert_eq!(high, [0; 3]);
        }
    }
}

#[test]
fn the_constant_decorated_with_workgroup_size_counts() {
    let compute = Workgroup {
        size: 1,
        annotations: "OpDecorate %size BuiltIn WorkgroupSize",
        declarations: "%size = OpConstantComposite %uint3 %4 %2 %1",
        body: "
            %x = OpCompositeExtract %uint %size 0
            %sum = OpIAdd %uint %i %x
            %pointer = OpAccessChain %ptr_uint %out %0 %i
            OpStore %pointer %sum",
        ..Workgroup::default()
    }
    .compute();
    let out = Buffer::zeroed(36);
    let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
    compute.dispatch(&resources, [1, 1, 1]).expect("no trap");
    // Four by two invocations, not LocalSize's one; each adds the width.
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&out.bytes());
    assert_eq!(words, [4, 5, 6, 7, 8, 9, 10, 11, 0]);
}
