//! The rules for rays, by the instruction that breaks one (Vulkan, "Runtime SPIR-V Validation").

use rspirv::spirv::Op as Opcode;

use crate::accel::RayRule;

/// The rules of one family of instructions, in the order of [`RayRule`]; 0 where there is none.
struct Family {
    opcodes: &'static [Opcode],
    /// What stands between `VUID-RuntimeSpirv-` and the number.
    name: &'static str,
    numbers: [u32; 10],
}

const FAMILIES: &[Family] = &[
    Family {
        opcodes: &[Opcode::TraceRayKHR, Opcode::TraceNV],
        name: "OpTraceRayKHR",
        numbers: [6358, 6355, 6356, 6357, 6893, 6892, 6552, 6553, 6554, 0],
    },
    Family {
        opcodes: &[Opcode::TraceRayMotionNV, Opcode::TraceMotionNV],
        name: "OpTraceRayMotionNV",
        numbers: [6364, 6361, 6362, 6363, 0, 0, 0, 0, 0, 6366],
    },
    Family {
        opcodes: &[Opcode::RayQueryInitializeKHR],
        name: "OpRayQueryInitializeKHR",
        numbers: [6351, 6348, 6349, 6350, 6891, 6890, 6889, 0, 0, 0],
    },
    Family {
        opcodes: &[Opcode::HitObjectTraceRayNV, Opcode::HitObjectTraceRayMotionNV],
        name: "OpHitObjectTraceRayNV",
        numbers: [7708, 7705, 7706, 7707, 7714, 7713, 7712, 7715, 7716, 7710],
    },
    Family {
        opcodes: &[
            Opcode::HitObjectTraceRayEXT,
            Opcode::HitObjectTraceRayMotionEXT,
            Opcode::HitObjectTraceReorderExecuteEXT,
            Opcode::HitObjectTraceMotionReorderExecuteEXT,
        ],
        name: "OpHitObjectTraceRayEXT",
        numbers: [11881, 11878, 11879, 11880, 11885, 11884, 11883, 11886, 11887, 11882],
    },
];

/// What a ray did wrong and, where the specification has numbered it for this instruction, the
/// rule.
pub fn describe(opcode: u16, broken: RayRule) -> String {
    let family = FAMILIES.iter().find(|family| family.opcodes.iter().any(|&known| known as u16 == opcode));
    match family.map(|family| (family.name, family.numbers[broken as usize])) {
        None | Some((_, 0)) => broken.describe().to_owned(),
        Some((name, number)) => format!("{} (VUID-RuntimeSpirv-{name}-{number:05})", broken.describe()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_instruction_has_its_own_number() {
        let told = |opcode, broken| describe(opcode as u16, broken);
        assert!(
            told(Opcode::TraceRayKHR, RayRule::Finite).ends_with("(VUID-RuntimeSpirv-OpTraceRayKHR-06355)")
        );
        assert!(told(Opcode::TraceRayMotionNV, RayRule::Time).ends_with("OpTraceRayMotionNV-06366)"));
        assert!(told(Opcode::HitObjectTraceRayMotionEXT, RayRule::Time).ends_with("TraceRayEXT-11882)"));
        assert!(told(Opcode::RayQueryInitializeKHR, RayRule::SkipFlags).ends_with("InitializeKHR-06889)"));
        // The specification has none for the flags of this instruction.
        assert!(!told(Opcode::TraceRayMotionNV, RayRule::OpacityFlags).contains("VUID"));
        assert!(!told(Opcode::HitObjectRecordMissEXT, RayRule::Finite).contains("VUID"));
    }
}
