//! Checks the declarations of an entry point against the rules on stages, storage classes and
//! types, before anything is lowered.
//!
//! Only what the entry point's call tree uses counts: compilers list variables that other entry
//! points of the module use. Validators leave part of this out (the builtins of
//! `SPV_NV_linear_swept_spheres`, the writes to hit attributes).

use crate::module::interface::{EntryPoint, InterfaceVariable, Stage};
use crate::module::names::storage_class_name;
use crate::module::{Definition, Id, Module, Opcode};
use crate::ops::builtin;
use crate::ops::pointer::storage;
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Vulkan's rules on a storage class of ray tracing.
struct StorageRule {
    class: u32,
    /// The stages that may use it, by letter as in `builtin`.
    stages: &'static str,
    /// The rule on stages.
    vuid: &'static str,
    /// The rule that an entry point uses at most one variable of it.
    single: Option<&'static str>,
}

const STORAGE_RULES: &[StorageRule] = &[
    StorageRule {
        class: storage::RAY_PAYLOAD,
        stages: "RCM",
        vuid: "VUID-StandaloneSpirv-RayPayloadKHR-04698",
        single: None,
    },
    StorageRule {
        class: storage::INCOMING_RAY_PAYLOAD,
        stages: "ACM",
        vuid: "VUID-StandaloneSpirv-IncomingRayPayloadKHR-04699",
        single: Some("VUID-StandaloneSpirv-IncomingRayPayloadKHR-04700"),
    },
    StorageRule {
        class: storage::HIT_ATTRIBUTE,
        stages: "IAC",
        vuid: "VUID-StandaloneSpirv-HitAttributeKHR-04701",
        single: Some("VUID-StandaloneSpirv-HitAttributeKHR-04702"),
    },
    StorageRule {
        class: storage::CALLABLE_DATA,
        stages: "RCMK",
        vuid: "VUID-StandaloneSpirv-CallableDataKHR-04704",
        single: None,
    },
    StorageRule {
        class: storage::INCOMING_CALLABLE_DATA,
        stages: "K",
        vuid: "VUID-StandaloneSpirv-IncomingCallableDataKHR-04705",
        single: Some("VUID-StandaloneSpirv-IncomingCallableDataKHR-04706"),
    },
    StorageRule {
        class: storage::SHADER_RECORD_BUFFER,
        stages: "RIACMK",
        vuid: "VUID-StandaloneSpirv-ShaderRecordBufferKHR-07119",
        single: None,
    },
];

/// Instructions that only some stages may contain (`SPV_KHR_ray_tracing`, each instruction's
/// section).
const INSTRUCTION_STAGES: &[(Opcode, &str)] = &[
    (Opcode::TraceRayKHR, "RCM"),
    (Opcode::TraceNV, "RCM"),
    (Opcode::ExecuteCallableKHR, "RCMK"),
    (Opcode::ExecuteCallableNV, "RCMK"),
    (Opcode::ReportIntersectionKHR, "I"),
    (Opcode::IgnoreIntersectionKHR, "A"),
    (Opcode::IgnoreIntersectionNV, "A"),
    (Opcode::TerminateRayKHR, "A"),
    (Opcode::TerminateRayNV, "A"),
];

/// Checks the variables (those of its interface) and instructions of an entry point.
///
/// # Errors
/// `InvalidModule` with the rule: a builtin in another stage, storage class or type than its own, a
/// ray-tracing storage class in another stage, two incoming variables, a write to hit attributes
/// outside an intersection shader, an instruction of another stage.
pub fn check(
    translator: &mut Translator<'_>,
    entry: &EntryPoint,
    variables: &[InterfaceVariable],
) -> Result<()> {
    let before = translator.origin;
    let module = translator.module;
    for variable in variables {
        translator.origin.offset = offset(module, variable.id);
        check_builtin(translator, variable)?;
        check_storage(translator, variable)?;
    }
    for rule in STORAGE_RULES {
        let mut all = variables.iter().filter(|variable| variable.storage_class == rule.class);
        if let (Some(vuid), Some(first), Some(second)) = (rule.single, all.next(), all.next()) {
            translator.origin.offset = offset(module, second.id);
            let message = format!(
                "%{} and %{} are both {} variables of `{}`: only one is allowed",
                first.id.0,
                second.id.0,
                storage_class_name(rule.class),
                entry.name
            );
            return Err(translator.invalid(message).note(vuid));
        }
    }
    let attributes: Vec<Id> = variables
        .iter()
        .filter(|variable| variable.storage_class == storage::HIT_ATTRIBUTE)
        .map(|variable| variable.id)
        .collect();
    check_instructions(translator, entry, &attributes)?;
    translator.origin = before;
    Ok(())
}

fn check_builtin(translator: &Translator<'_>, variable: &InterfaceVariable) -> Result<()> {
    let (Some(number), Some(ty)) = (variable.builtin, variable.ty) else { return Ok(()) };
    let Some(builtin) = builtin::find(number) else { return Ok(()) };
    if variable.storage_class != storage::INPUT {
        let found = storage_class_name(variable.storage_class);
        let message = format!("the builtin {} is in storage class {found}, not Input", builtin.name);
        return Err(translator.invalid(message).note(format!("VUID-{}", builtin.vuids[1])));
    }
    builtin::check(translator, builtin, ty)
}

fn check_storage(translator: &Translator<'_>, variable: &InterfaceVariable) -> Result<()> {
    let rule = STORAGE_RULES.iter().find(|rule| rule.class == variable.storage_class);
    let Some(rule) = rule.filter(|rule| !rule.stages.contains(builtin::stage_letter(translator.stage)))
    else {
        return Ok(());
    };
    let (class, stage) = (storage_class_name(rule.class), translator.stage.name());
    let message = format!("a {class} variable cannot be used in {stage}");
    Err(translator.invalid(message).note(rule.vuid))
}

fn check_instructions(translator: &mut Translator<'_>, entry: &EntryPoint, attributes: &[Id]) -> Result<()> {
    let module = translator.module;
    let letter = builtin::stage_letter(translator.stage);
    for function in module.call_tree(entry.function) {
        for instruction in module.functions[function as usize].instructions() {
            translator.origin.offset = instruction.offset;
            let limited = INSTRUCTION_STAGES.iter().find(|(opcode, _)| *opcode == instruction.opcode);
            if let Some((opcode, _)) = limited.filter(|(_, stages)| !stages.contains(letter)) {
                let message = format!("Op{opcode:?} cannot be used in {}", translator.stage.name());
                return Err(translator.invalid(message).note("SPV_KHR_ray_tracing"));
            }
            let writes = || {
                let pointer = module.operands(instruction).first().copied();
                pointer.and_then(|pointer| base_variable(module, Id(pointer)))
            };
            let stores = instruction.opcode == Opcode::Store;
            if stores
                && translator.stage != Stage::Intersection
                && !attributes.is_empty()
                && writes().is_some_and(|variable| attributes.contains(&variable))
            {
                let message = format!("hit attributes are written in {}", translator.stage.name());
                return Err(translator.invalid(message).note("VUID-StandaloneSpirv-HitAttributeKHR-04703"));
            }
        }
    }
    Ok(())
}

/// The variable of module scope that a chain of access chains begins at.
pub fn base_variable(module: &Module, mut pointer: Id) -> Option<Id> {
    loop {
        match module.definition(pointer)? {
            Definition::Variable(_) => return Some(pointer),
            Definition::Result(..) => {
                let instruction = module.result_instruction(pointer)?;
                pointer = match (instruction.opcode, module.access_chain(instruction)) {
                    (_, Some(chain)) if chain.element.is_none() => chain.base,
                    (Opcode::CopyObject | Opcode::FreezeKHR, _) => {
                        Id(*module.operands(instruction).first()?)
                    }
                    _ => return None,
                };
            }
            _ => return None,
        }
    }
}

/// The offset of a variable in the module, in words.
fn offset(module: &Module, variable: Id) -> u32 {
    module.variables.iter().find(|one| one.id == variable).map_or(0, |one| one.offset)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::module::assemble::Assembler;
    use crate::ops::builtin::{BUILTINS, ValueShape};
    use anyhit_base::error::{Error, ErrorKind};

    const STAGES: [(u32, char); 6] =
        [(5313, 'R'), (5314, 'I'), (5315, 'A'), (5316, 'C'), (5317, 'M'), (5318, 'K')];

    /// A module with one variable that its entry point reads.
    fn reading(model: u32, class: u32, builtin: u32, shape: ValueShape) -> Result<()> {
        let mut a = Assembler::new();
        a.with_string(Opcode::EntryPoint, &[model, 40], "main", &[30]);
        a.op(Opcode::Decorate, &[30, 11, builtin]);
        a.types();
        a.op(Opcode::TypeVector, &[63, 5, 3]);
        a.op(Opcode::TypeVector, &[64, 5, 4]);
        a.op(Opcode::TypeVector, &[72, 6, 2]);
        a.op(Opcode::TypeVector, &[73, 5, 2]);
        a.op(Opcode::TypeMatrix, &[66, 7, 4]);
        a.op(Opcode::Constant, &[5, 70, 2]);
        a.op(Opcode::TypeArray, &[67, 6, 70]);
        a.op(Opcode::TypeArray, &[68, 7, 70]);
        a.op(Opcode::TypeArray, &[69, 7, 8]);
        let ty = match shape {
            ValueShape::Bool => 3,
            ValueShape::Int => 5,
            ValueShape::Float => 6,
            ValueShape::Int2 => 73,
            ValueShape::Int3 => 63,
            ValueShape::Int4 => 64,
            ValueShape::Float2 => 72,
            ValueShape::Float3 => 7,
            ValueShape::Matrix4x3 => 66,
            ValueShape::FloatArray2 => 67,
            ValueShape::Float3Array2 => 68,
            ValueShape::Float3Array3 => 69,
        };
        a.op(Opcode::TypePointer, &[80, class, ty]);
        a.op(Opcode::Variable, &[80, 30, class]);
        a.function(40, 41, |a| {
            a.op(Opcode::Load, &[ty, 42, 30]);
            a.op(Opcode::Return, &[]);
        });
        check_first(&Arc::new(a.loaded()))
    }

    fn check_first(module: &Arc<Module>) -> Result<()> {
        let entry = &module.entry_points[0];
        check(&mut Translator::new(module, entry.stage), entry, &module.interface_of(entry))
    }

    fn rule(result: Result<()>) -> Option<String> {
        let error: Error = result.err()?;
        assert_eq!(error.kind(), ErrorKind::InvalidModule);
        error.notes().first().cloned()
    }

    /// What the Vulkan specification says of each builtin ("Built-In Variables"), written down by
    /// itself: name, number, stages (all seven where it names none), the numbers of the rules on
    /// stage, storage class and type, and the type. Where no rule speaks of stages the one on
    /// storage class stands.
    #[rustfmt::skip]
    const RULES: &[(&str, u32, &str, [u32; 3], ValueShape)] = &[
        ("InstanceId", 6, "IAC", [4254, 4255, 4256], ValueShape::Int),
        ("PrimitiveId", 7, "IAC", [4330, 4334, 4337], ValueShape::Int),
        ("NumWorkgroups", 24, "G", [4296, 4297, 4298], ValueShape::Int3),
        ("WorkgroupSize", 25, "G", [4425, 4426, 4427], ValueShape::Int3),
        ("WorkgroupId", 26, "G", [4422, 4423, 4424], ValueShape::Int3),
        ("LocalInvocationId", 27, "G", [4281, 4282, 4283], ValueShape::Int3),
        ("GlobalInvocationId", 28, "G", [4236, 4237, 4238], ValueShape::Int3),
        ("LocalInvocationIndex", 29, "G", [4284, 4285, 4286], ValueShape::Int),
        ("SubgroupSize", 36, "RIACMKG", [4382, 4382, 4383], ValueShape::Int),
        ("NumSubgroups", 38, "G", [4293, 4294, 4295], ValueShape::Int),
        ("SubgroupId", 40, "G", [4367, 4368, 4369], ValueShape::Int),
        ("SubgroupLocalInvocationId", 41, "RIACMKG", [4380, 4380, 4381], ValueShape::Int),
        ("CoreIDARM", 4160, "RIACMKG", [7599, 7599, 7600], ValueShape::Int),
        ("CoreCountARM", 4161, "RIACMKG", [7595, 7595, 7596], ValueShape::Int),
        ("CoreMaxIDARM", 4162, "RIACMKG", [7597, 7597, 7598], ValueShape::Int),
        ("WarpIDARM", 4163, "RIACMKG", [7603, 7603, 7604], ValueShape::Int),
        ("WarpMaxIDARM", 4164, "RIACMKG", [7601, 7601, 7602], ValueShape::Int),
        ("SubgroupEqMask", 4416, "RIACMKG", [4370, 4370, 4371], ValueShape::Int4),
        ("SubgroupGeMask", 4417, "RIACMKG", [4372, 4372, 4373], ValueShape::Int4),
        ("SubgroupGtMask", 4418, "RIACMKG", [4374, 4374, 4375], ValueShape::Int4),
        ("SubgroupLeMask", 4419, "RIACMKG", [4376, 4376, 4377], ValueShape::Int4),
        ("SubgroupLtMask", 4420, "RIACMKG", [4378, 4378, 4379], ValueShape::Int4),
        ("DeviceIndex", 4438, "RIACMKG", [4205, 4205, 4206], ValueShape::Int),
        ("LaunchIdKHR", 5319, "RIACMK", [4266, 4267, 4268], ValueShape::Int3),
        ("LaunchSizeKHR", 5320, "RIACMK", [4269, 4270, 4271], ValueShape::Int3),
        ("WorldRayOriginKHR", 5321, "IACM", [4431, 4432, 4433], ValueShape::Float3),
        ("WorldRayDirectionKHR", 5322, "IACM", [4428, 4429, 4430], ValueShape::Float3),
        ("ObjectRayOriginKHR", 5323, "IAC", [4302, 4303, 4304], ValueShape::Float3),
        ("ObjectRayDirectionKHR", 5324, "IAC", [4299, 4300, 4301], ValueShape::Float3),
        ("RayTminKHR", 5325, "IACM", [4351, 4352, 4353], ValueShape::Float),
        ("RayTmaxKHR", 5326, "IACM", [4348, 4349, 4350], ValueShape::Float),
        ("InstanceCustomIndexKHR", 5327, "IAC", [4251, 4252, 4253], ValueShape::Int),
        ("ObjectToWorldKHR", 5330, "IAC", [4305, 4306, 4307], ValueShape::Matrix4x3),
        ("WorldToObjectKHR", 5331, "IAC", [4434, 4435, 4436], ValueShape::Matrix4x3),
        ("HitTNV", 5332, "AC", [4245, 4246, 4247], ValueShape::Float),
        ("HitKindKHR", 5333, "AC", [4242, 4243, 4244], ValueShape::Int),
        ("CurrentRayTimeNV", 5334, "IACM", [4942, 4943, 4944], ValueShape::Float),
        ("HitTriangleVertexPositionsKHR", 5335, "AC", [8747, 8748, 8749], ValueShape::Float3Array3),
        ("IncomingRayFlagsKHR", 5351, "IACM", [4248, 4249, 4250], ValueShape::Int),
        ("RayGeometryIndexKHR", 5352, "IAC", [4345, 4346, 4347], ValueShape::Int),
        ("HitIsSphereNV", 5359, "AC", [10513, 10514, 10515], ValueShape::Bool),
        ("HitIsLSSNV", 5360, "AC", [10516, 10517, 10518], ValueShape::Bool),
        ("HitSpherePositionNV", 5361, "AC", [10519, 10520, 10521], ValueShape::Float3),
        ("WarpsPerSMNV", 5374, "RIACMKG", [4418, 4418, 4419], ValueShape::Int),
        ("SMCountNV", 5375, "RIACMKG", [4363, 4363, 4364], ValueShape::Int),
        ("WarpIDNV", 5376, "RIACMKG", [4420, 4420, 4421], ValueShape::Int),
        ("SMIDNV", 5377, "RIACMKG", [4365, 4365, 4366], ValueShape::Int),
        ("HitLSSPositionsNV", 5396, "AC", [10525, 10526, 10527], ValueShape::Float3Array2),
        ("HitSphereRadiusNV", 5420, "AC", [10522, 10523, 10524], ValueShape::Float),
        ("HitLSSRadiiNV", 5421, "AC", [10528, 10529, 10530], ValueShape::FloatArray2),
        ("ClusterIDNV", 5436, "AC", [10531, 10532, 10533], ValueShape::Int),
        ("CullMaskKHR", 6021, "IACM", [6735, 6736, 6737], ValueShape::Int),
    ];

    /// Every builtin in every stage, in every storage class that a variable may have, of every
    /// type.
    #[test]
    fn every_builtin_obeys_its_three_rules() {
        let known: Vec<&str> = BUILTINS.iter().map(|builtin| builtin.name).collect();
        assert_eq!(known, RULES.iter().map(|rule| rule.0).collect::<Vec<_>>());
        for &(name, number, stages, numbers, shape) in RULES {
            let [stage_rule, storage_rule, type_rule] =
                numbers.map(|number| Some(format!("VUID-{name}-{name}-{number:05}")));
            for (model, letter) in STAGES.into_iter().chain([(5, 'G')]) {
                let found = |class, shape| rule(reading(model, class, number, shape));
                if !stages.contains(letter) {
                    assert_eq!(found(storage::INPUT, shape), stage_rule, "{name} in {letter}");
                    continue;
                }
                for other in ValueShape::ALL {
                    let wanted = if other == shape { None } else { type_rule.clone() };
                    assert_eq!(found(storage::INPUT, other), wanted, "{name} in {letter} as {other:?}");
                }
                // Uniform, Output, Workgroup, Private, StorageBuffer
                for class in [2, 3, 4, storage::PRIVATE, 12] {
                    assert_eq!(
                        found(class, shape),
                        storage_rule,
                        "{name} in {letter}, storage class {class}"
                    );
                }
            }
        }
    }

    /// A module whose entry point loads one variable of each class named, and stores to the first.
    fn using(model: u32, classes: &[u32], stores: bool) -> Result<()> {
        let mut a = Assembler::new();
        a.with_string(Opcode::EntryPoint, &[model, 40], "main", &[]);
        a.types();
        for (at, &class) in classes.iter().enumerate() {
            a.op(Opcode::TypePointer, &[80 + at as u32, class, 6]);
            a.op(Opcode::Variable, &[80 + at as u32, 90 + at as u32, class]);
        }
        a.function(40, 41, |a| {
            for at in 0..classes.len() as u32 {
                a.op(Opcode::Load, &[6, 100 + at, 90 + at]);
            }
            if stores {
                a.op(Opcode::Store, &[90, 100]);
            }
            a.op(Opcode::Return, &[]);
        });
        check_first(&Arc::new(a.loaded()))
    }

    #[test]
    fn storage_classes_keep_to_their_stages() {
        for one in STORAGE_RULES {
            for (model, letter) in STAGES.into_iter().chain([(5, 'G')]) {
                let found = rule(using(model, &[one.class], false));
                let wanted = (!one.stages.contains(letter)).then(|| one.vuid.to_owned());
                assert_eq!(found, wanted, "{} in {letter}", storage_class_name(one.class));
            }
        }
        for (model, class) in [
            (5316, storage::INCOMING_RAY_PAYLOAD),
            (5314, storage::HIT_ATTRIBUTE),
            (5318, storage::INCOMING_CALLABLE_DATA),
        ] {
            let single = STORAGE_RULES.iter().find(|rule| rule.class == class).and_then(|rule| rule.single);
            assert_eq!(rule(using(model, &[class, class], false)).as_deref(), single);
        }
        assert_eq!(rule(using(5313, &[storage::RAY_PAYLOAD; 3], false)), None);
    }

    #[test]
    fn only_intersection_shaders_write_hit_attributes() {
        let written = Some("VUID-StandaloneSpirv-HitAttributeKHR-04703".to_owned());
        assert_eq!(rule(using(5314, &[storage::HIT_ATTRIBUTE], true)), None);
        assert_eq!(rule(using(5315, &[storage::HIT_ATTRIBUTE], true)), written);
        assert_eq!(rule(using(5316, &[storage::HIT_ATTRIBUTE], true)), written);
        assert_eq!(rule(using(5316, &[storage::INCOMING_RAY_PAYLOAD, storage::HIT_ATTRIBUTE], true)), None);
    }

    #[test]
    fn instructions_keep_to_their_stages() {
        let with = |model: u32, opcode: Opcode| {
            let mut a = Assembler::new();
            a.with_string(Opcode::EntryPoint, &[model, 40], "main", &[]);
            a.types();
            a.function(40, 41, |a| {
                let operands: &[u32] = match opcode {
                    Opcode::TraceRayKHR => &[8; 11],
                    Opcode::ExecuteCallableKHR => &[8; 2],
                    Opcode::ReportIntersectionKHR => &[3, 50, 8, 8],
                    _ => &[],
                };
                a.op(opcode, operands);
                if !operands.is_empty() {
                    a.op(Opcode::Return, &[]);
                }
            });
            check_first(&Arc::new(a.loaded()))
        };
        for (opcode, stages) in [
            (Opcode::TraceRayKHR, "RCM"),
            (Opcode::ExecuteCallableKHR, "RCMK"),
            (Opcode::ReportIntersectionKHR, "I"),
            (Opcode::IgnoreIntersectionKHR, "A"),
            (Opcode::TerminateRayKHR, "A"),
        ] {
            for (model, letter) in STAGES {
                let found = with(model, opcode).err().map(|error| error.message().to_owned());
                if stages.contains(letter) {
                    assert_eq!(found, None, "{opcode:?} in {letter}");
                } else {
                    let wanted = format!("Op{opcode:?} cannot");
                    assert!(found.is_some_and(|text| text.starts_with(&wanted)), "{opcode:?} in {letter}");
                }
            }
        }
    }
}
