//! The rules for rays, by the instruction that breaks one (Vulkan, "Runtime SPIR-V Validation").

use crate::module::Opcode;

use crate::accel::RayRule;

/// The rules of a group of instructions, in the order of [`RayRule`]; 0 where there is none.
struct InstructionRules {
    opcodes: &'static [Opcode],
    /// The part of the VUID between `VUID-RuntimeSpirv-` and the number.
    name: &'static str,
    numbers: [u32; 10],
}

const RULES: &[InstructionRules] = &[
    InstructionRules {
        opcodes: &[Opcode::TraceRayKHR, Opcode::TraceNV],
        name: "OpTraceRayKHR",
        numbers: [6358, 6355, 6356, 6357, 6893, 6892, 6552, 6553, 6554, 0],
    },
    InstructionRules {
        opcodes: &[Opcode::TraceRayMotionNV, Opcode::TraceMotionNV],
        name: "OpTraceRayMotionNV",
        numbers: [6364, 6361, 6362, 6363, 0, 0, 0, 0, 0, 6366],
    },
    InstructionRules {
        opcodes: &[Opcode::RayQueryInitializeKHR],
        name: "OpRayQueryInitializeKHR",
        numbers: [6351, 6348, 6349, 6350, 6891, 6890, 6889, 0, 0, 0],
    },
    InstructionRules {
        opcodes: &[Opcode::HitObjectTraceRayNV, Opcode::HitObjectTraceRayMotionNV],
        name: "OpHitObjectTraceRayNV",
        numbers: [7708, 7705, 7706, 7707, 7714, 7713, 7712, 7715, 7716, 7710],
    },
    InstructionRules {
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
pub fn describe(opcode: Opcode, broken: RayRule) -> String {
    match vuid(opcode, broken) {
        None => broken.describe().to_owned(),
        Some(vuid) => format!("{} ({vuid})", broken.describe()),
    }
}

/// What a ray that the host traces did wrong, as of `OpTraceRayKHR`.
pub fn describe_of_trace(broken: RayRule) -> String {
    describe(Opcode::TraceRayKHR, broken)
}

/// The rule, where the specification has numbered it for this instruction.
pub fn vuid(opcode: Opcode, broken: RayRule) -> Option<String> {
    let rules = RULES.iter().find(|rules| rules.opcodes.contains(&opcode))?;
    let number = Some(rules.numbers[broken as usize]).filter(|&number| number > 0)?;
    Some(format!("VUID-RuntimeSpirv-{}-{number:05}", rules.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_instruction_has_its_own_number() {
        let text = |opcode, broken| describe(opcode, broken);
        assert!(
            text(Opcode::TraceRayKHR, RayRule::Finite).ends_with("(VUID-RuntimeSpirv-OpTraceRayKHR-06355)")
        );
        assert!(text(Opcode::TraceRayMotionNV, RayRule::Time).ends_with("OpTraceRayMotionNV-06366)"));
        assert!(text(Opcode::HitObjectTraceRayMotionEXT, RayRule::Time).ends_with("TraceRayEXT-11882)"));
        assert!(text(Opcode::RayQueryInitializeKHR, RayRule::SkipFlags).ends_with("InitializeKHR-06889)"));
        // The specification has none for the flags of this instruction.
        assert!(!text(Opcode::TraceRayMotionNV, RayRule::OpacityFlags).contains("VUID"));
        assert!(!text(Opcode::HitObjectRecordMissEXT, RayRule::Finite).contains("VUID"));
    }
}
