//! Which ids of a hit an index is: that of the instance, its custom one, that of the primitive or
//! of the geometry.

use rustc_hash::FxHashMap;

use crate::module::decoration::number;
use crate::module::{Definition, Id, Instruction, Module, Opcode};
use anyhit_base::sorted::sort;

/// An id of a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum HitId {
    /// `InstanceId`, the number of the instance in its acceleration structure.
    Instance,
    /// `InstanceCustomIndexKHR`, what the host gave the instance.
    InstanceCustom,
    /// `PrimitiveId`, the number of the primitive in its geometry.
    Primitive,
    /// `RayGeometryIndexKHR`, the number of the geometry in its acceleration structure.
    Geometry,
}

impl HitId {
    /// The name of its builtin.
    pub fn name(self) -> &'static str {
        match self {
            Self::Instance => "InstanceId",
            Self::InstanceCustom => "InstanceCustomIndexKHR",
            Self::Primitive => "PrimitiveId",
            Self::Geometry => "RayGeometryIndexKHR",
        }
    }

    fn of_builtin(number: u32) -> Option<Self> {
        Some(match number {
            6 => Self::Instance,
            5327 => Self::InstanceCustom,
            7 => Self::Primitive,
            5352 => Self::Geometry,
            _ => return None,
        })
    }

    fn of_query(opcode: Opcode) -> Option<Self> {
        Some(match opcode {
            Opcode::RayQueryGetIntersectionInstanceIdKHR | Opcode::HitObjectGetInstanceIdNV => Self::Instance,
            Opcode::RayQueryGetIntersectionInstanceCustomIndexKHR
            | Opcode::HitObjectGetInstanceCustomIndexNV => Self::InstanceCustom,
            Opcode::RayQueryGetIntersectionPrimitiveIndexKHR | Opcode::HitObjectGetPrimitiveIndexNV => {
                Self::Primitive
            }
            Opcode::RayQueryGetIntersectionGeometryIndexKHR | Opcode::HitObjectGetGeometryIndexNV => {
                Self::Geometry
            }
            _ => return None,
        })
    }
}

/// Finds out which ids of a hit the values of a module are.
#[derive(Debug)]
pub struct HitIds<'a> {
    module: &'a Module,
    /// By pointer: what is stored through it.
    stored: FxHashMap<Id, Vec<Id>>,
    /// By parameter: what calls pass for it.
    arguments: FxHashMap<Id, Vec<Id>>,
}

impl<'a> HitIds<'a> {
    /// Of a module.
    pub fn new(module: &'a Module) -> Self {
        let mut ids = Self { module, stored: FxHashMap::default(), arguments: FxHashMap::default() };
        for instruction in module.instructions() {
            match (instruction.opcode, module.operands(instruction)) {
                (Opcode::Store, &[pointer, object, ..]) => {
                    ids.stored.entry(Id(pointer)).or_default().push(Id(object));
                }
                (Opcode::FunctionCall, [callee, passed @ ..]) => {
                    let Some(callee) = module.function(Id(*callee)) else { continue };
                    for (&(parameter, _), &argument) in callee.parameters.iter().zip(passed) {
                        ids.arguments.entry(parameter).or_default().push(Id(argument));
                    }
                }
                _ => {}
            }
        }
        ids
    }

    /// The id that a value is, if it is nothing else.
    pub fn same(&self, value: Id) -> Option<HitId> {
        let mut found = Vec::new();
        self.follow(value, false, &mut Vec::new(), &mut found).then_some(())?;
        found.dedup();
        match found[..] {
            [id] => Some(id),
            _ => None,
        }
    }

    /// The ids that a value is computed from, in their order.
    pub fn among(&self, value: Id) -> Vec<HitId> {
        let mut found = Vec::new();
        self.follow(value, true, &mut Vec::new(), &mut found);
        sort(&mut found);
        found.dedup();
        found
    }

    /// Adds the ids that a value is, or is computed from; returns whether it is nothing else.
    fn follow(&self, value: Id, computes: bool, seen: &mut Vec<Id>, found: &mut Vec<HitId>) -> bool {
        if seen.contains(&value) {
            return true;
        }
        seen.push(value);
        let mut all = |ids: &[Id]| {
            // Each is followed, so that all are found.
            let followed = ids.iter().map(|&id| self.follow(id, computes, seen, found));
            followed.fold(!ids.is_empty(), |all, one| all & one)
        };
        let variable = [&self.stored, &self.arguments].into_iter().find_map(|map| map.get(&value));
        if let Some(sources) = variable {
            return all(sources);
        }
        if let Some(id) = self.builtin(value) {
            found.push(id);
            return true;
        }
        let Some(instruction) = self.result(value) else { return false };
        let opcode = instruction.opcode;
        if let Some(id) = HitId::of_query(opcode) {
            found.push(id);
            return true;
        }
        let operands = self.module.operand_ids(instruction);
        match opcode {
            Opcode::Load
            | Opcode::CopyObject
            | Opcode::FreezeKHR
            | Opcode::Bitcast
            | Opcode::UConvert
            | Opcode::SConvert => operands.first().is_some_and(|&operand| all(&[operand])),
            Opcode::IAdd
            | Opcode::ISub
            | Opcode::IMul
            | Opcode::UDiv
            | Opcode::UMod
            | Opcode::ShiftLeftLogical
            | Opcode::BitwiseAnd
                if computes =>
            {
                all(&operands);
                false
            }
            _ => false,
        }
    }

    fn builtin(&self, variable: Id) -> Option<HitId> {
        self.module.decorations.literal(variable, number::BUILT_IN).and_then(HitId::of_builtin)
    }

    /// The instruction in a function that an id is the result of.
    fn result(&self, id: Id) -> Option<&'a Instruction> {
        let Definition::Result(function, block, at) = self.module.definition(id)? else { return None };
        let block = self.module.functions[function as usize].blocks.get(block as usize)?;
        block.instructions.get(at as usize)
    }
}
