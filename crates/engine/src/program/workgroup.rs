//! The workgroup size and the derivative groups of a compute entry point.

use crate::module::Id;
use crate::module::decoration::number;
use crate::module::interface::EntryPoint;
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Execution modes, numbers of the specification.
const LOCAL_SIZE: u32 = 17;
const LOCAL_SIZE_ID: u32 = 38;
const DERIVATIVE_GROUP_QUADS: u32 = 5289;
const DERIVATIVE_GROUP_LINEAR: u32 = 5290;

/// More invocations than `maxComputeWorkGroupInvocations` of any device.
pub const MAX_INVOCATIONS: u64 = 1 << 16;

/// The workgroups of a compute entry point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkgroupLayout {
    /// `WorkgroupSize`
    pub size: [u32; 3],
    /// Bytes of workgroup memory.
    pub memory: u32,
    /// How invocations form quads for derivatives, where they do.
    pub derivatives: Option<DerivativeGroup>,
}

/// How the invocations of a workgroup form quads (`SPV_KHR_compute_shader_derivatives`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DerivativeGroup {
    /// Squares of two by two by `LocalInvocationId`.
    Quads,
    /// Four that are consecutive by `LocalInvocationIndex`.
    Linear,
}

impl DerivativeGroup {
    /// The derivative group that an entry point declares.
    pub fn of(entry: &EntryPoint) -> Option<Self> {
        entry.modes.iter().find_map(|(mode, _)| match *mode {
            DERIVATIVE_GROUP_QUADS => Some(Self::Quads),
            DERIVATIVE_GROUP_LINEAR => Some(Self::Linear),
            _ => None,
        })
    }

    /// The rule that a workgroup's size breaks.
    fn broken_rule(self, [x, y, z]: [u64; 3]) -> Option<&'static str> {
        match self {
            Self::Quads if x % 2 != 0 || y % 2 != 0 => {
                Some("VUID-StandaloneSpirv-DerivativeGroupQuadsKHR-10151")
            }
            Self::Linear if x * y * z % 4 != 0 => Some("VUID-StandaloneSpirv-DerivativeGroupLinearKHR-10152"),
            _ => None,
        }
    }
}

impl WorkgroupLayout {
    /// The layout that an entry point declares, once its instructions are translated: a constant
    /// decorated with `WorkgroupSize` has precedence over `LocalSizeId` and `LocalSize` (SPIR-V,
    /// Built-In).
    ///
    /// # Errors
    /// `InvalidModule` where nothing tells the size (VUID-StandaloneSpirv-None-10685) or it is
    /// zero; `UnsupportedModule` for sizes beyond those of any device.
    pub fn of(translator: &mut Translator<'_>, entry: &EntryPoint) -> Result<Self> {
        let derivatives = DerivativeGroup::of(entry);
        translator.origin.offset = entry.offset;
        let module = translator.module;
        // Few ids are decorated so; a module may have many constants and entry points.
        let decorated = match &module.decorations.workgroup_sizes[..] {
            [] => None,
            ids => module.constants.iter().find(|constant| {
                let built_in = module.decorations.literal(constant.id, number::BUILT_IN);
                ids.contains(&constant.id) && built_in == Some(number::WORKGROUP_SIZE)
            }),
        };
        let mode = |number| entry.modes.iter().find(|(mode, _)| *mode == number).map(|(_, words)| words);
        let literal = decorated.is_none() && mode(LOCAL_SIZE_ID).is_none();
        let sides: Vec<u64> = if let Some(constant) = decorated {
            let words = translator.words(constant.id)?;
            words.iter().filter_map(|&reg| translator.constant_word(reg)).map(u64::from).collect()
        } else if let Some(ids) = mode(LOCAL_SIZE_ID) {
            ids.iter().map(|&id| translator.constant_integer(Id(id))).collect::<Result<_>>()?
        } else if let Some(sides) = mode(LOCAL_SIZE) {
            sides.iter().map(|&side| u64::from(side)).collect()
        } else {
            let message = format!("compute entry point `{}` declares no workgroup size", entry.name);
            return Err(translator.invalid(message).note("VUID-StandaloneSpirv-None-10685"));
        };
        let &[x, y, z] = &sides[..] else {
            return Err(translator
                .invalid(format!("entry point `{}`: a workgroup size has three dimensions", entry.name)));
        };
        let count = x.checked_mul(y).and_then(|area| area.checked_mul(z));
        match count {
            Some(0) => {
                let message =
                    format!("entry point `{}`: a workgroup of {x} x {y} x {z} invocations", entry.name);
                // For constants it is no error of the module: specialization may change them.
                Err(if literal { translator.invalid(message) } else { translator.unsupported(message) })
            }
            Some(1..=MAX_INVOCATIONS) => {
                if let Some(rule) = derivatives.and_then(|group| group.broken_rule([x, y, z])) {
                    let message = format!(
                        "entry point `{}`: a workgroup of {x} x {y} x {z} invocations does not divide \
                         into quads",
                        entry.name
                    );
                    return Err(translator.invalid(message).note(rule));
                }
                let (size, memory) = ([x as u32, y as u32, z as u32], translator.workgroup_size);
                Ok(Self { size, memory, derivatives })
            }
            _ => Err(translator.unsupported(format!(
                "entry point `{}`: a workgroup of {x} x {y} x {z} invocations exceeds the supported \
                 {MAX_INVOCATIONS}",
                entry.name
            ))),
        }
    }
}

impl WorkgroupLayout {
    /// The `LocalInvocationIndex` of the invocation at a position in the order in which invocations
    /// are assigned to quads and subgroups.
    pub fn index_of(&self, position: u32) -> u32 {
        if self.derivatives != Some(DerivativeGroup::Quads) {
            return position;
        }
        let [width, height, _] = self.size;
        let (quad, part) = (position / 4, position % 4);
        let (across, layer) = (width / 2, width * height);
        let (z, quad) = (quad / (layer / 4), quad % (layer / 4));
        let (x, y) = (quad % across * 2 + part % 2, quad / across * 2 + part / 2);
        z * layer + y * width + x
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::module::Opcode;
    use crate::module::assemble::{Assembler, string_words};
    use crate::program::lower;

    #[test]
    fn quads_by_hand() {
        let layout =
            WorkgroupLayout { size: [4, 2, 2], memory: 0, derivatives: Some(DerivativeGroup::Quads) };
        let order: Vec<u32> = (0..16).map(|place| layout.index_of(place)).collect();
        assert_eq!(order, [0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15]);
        let linear = WorkgroupLayout { derivatives: Some(DerivativeGroup::Linear), ..layout };
        assert_eq!(linear.index_of(5), 5);
    }

    #[test]
    fn workgroups_fall_into_quads() {
        let rule = |group: DerivativeGroup, size| group.broken_rule(size);
        assert_eq!(rule(DerivativeGroup::Quads, [2, 4, 3]), None);
        for size in [[3, 2, 1], [4, 1, 1]] {
            let wanted = Some("VUID-StandaloneSpirv-DerivativeGroupQuadsKHR-10151");
            assert_eq!(rule(DerivativeGroup::Quads, size), wanted, "{size:?}");
        }
        for size in [[4, 1, 1], [1, 2, 6]] {
            assert_eq!(rule(DerivativeGroup::Linear, size), None, "{size:?}");
        }
        let wanted = Some("VUID-StandaloneSpirv-DerivativeGroupLinearKHR-10152");
        assert_eq!(rule(DerivativeGroup::Linear, [3, 2, 1]), wanted);
    }

    /// The workgroup sizes of two entry points with a `LocalSize` of 1, 1, 1, beside the constants
    /// (2, 3, 4) and (5, 6, 7), of which one may be decorated.
    fn sizes(decorated: Option<u32>) -> [[u32; 3]; 2] {
        let mut a = Assembler::new();
        for (id, name) in [(20, "first"), (30, "second")] {
            a.op(Opcode::EntryPoint, &[&[5, id][..], &string_words(name)].concat());
        }
        for id in [20, 30] {
            a.op(Opcode::ExecutionMode, &[id, LOCAL_SIZE, 1, 1, 1]);
        }
        if let Some(id) = decorated {
            a.op(Opcode::Decorate, &[id, number::BUILT_IN, 25]);
        }
        a.types();
        a.op(Opcode::TypeVector, &[9, 5, 3]);
        for side in 2..8 {
            a.op(Opcode::Constant, &[5, 40 + side, side]);
        }
        a.op(Opcode::ConstantComposite, &[9, 50, 42, 43, 44]);
        a.op(Opcode::ConstantComposite, &[9, 51, 45, 46, 47]);
        for id in [20, 30] {
            a.function(id, id + 1, |a| {
                a.op(Opcode::Return, &[]);
            });
        }
        let module = Arc::new(a.loaded());
        [0, 1].map(|at| lower(&module, &module.entry_points[at]).unwrap().workgroup.unwrap().size)
    }

    #[test]
    fn a_decorated_constant_is_the_size_of_all_entry_points() {
        // SPIR-V, BuiltIn, WorkgroupSize: it takes precedence over LocalSize.
        assert_eq!(sizes(None), [[1; 3]; 2]);
        assert_eq!(sizes(Some(50)), [[2, 3, 4]; 2]);
        assert_eq!(sizes(Some(51)), [[5, 6, 7]; 2]);
    }
}
