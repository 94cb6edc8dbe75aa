//! Sums of products with one rounding instead of two, where the module allows it.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::harness::stability::no_contraction;
use crate::machine::{Batch, ChoiceKind, DrawnDetails, OpIndex, OpenChoices, Reg};
use crate::module::Id;
use crate::module::ty::Type;
use crate::ops::memory::MemoryOp;
use crate::ops::op::Op;
use crate::program::Program;

/// The capability `FloatControls2` (`SPV_KHR_float_controls2`).
const FLOAT_CONTROLS2: u32 = 6029;
/// The decoration `FPFastMathMode`.
const FP_FAST_MATH_MODE: u32 = 40;
/// The execution mode `FPFastMathDefault`.
const FP_FAST_MATH_DEFAULT: u32 = 6028;
/// `AllowContract`, a bit of `FP Fast Math Mode`.
const ALLOW_CONTRACT: u64 = 0x1_0000;

/// The operations of a program that may be contracted.
#[derive(Debug)]
pub(super) struct Contractions {
    /// Sums, differences and products of 32-bit floats, with the words of their instructions.
    allowed: FxHashMap<OpIndex, u32>,
}

/// Products that are in a register, lane by lane.
#[derive(Clone, Debug)]
struct Products {
    factors: Vec<[f32; 2]>,
    /// The rounded products, which tell whether the register still holds them.
    rounded: Vec<u32>,
}

/// The products in the registers of the batch that runs.
#[derive(Debug, Default)]
pub(super) struct LiveProducts {
    by_register: FxHashMap<Reg, Products>,
}

impl LiveProducts {
    /// Forgets all products, as another batch runs.
    pub(super) fn clear(&mut self) {
        self.by_register.clear();
    }
}

impl Contractions {
    /// The operations of a program that may be contracted.
    pub(super) fn of(program: &Program) -> Self {
        let forbidden = forbidden(program);
        let may = |(at, op): (usize, &Op)| {
            let Op::LaneKernel { kernel, .. } = op else { return None };
            let offset = program.origins.get(at)?.offset;
            let is_one = matches!(kernel.name, "FAdd" | "FSub" | "FMul") && kernel.float_result == 32;
            (is_one && !forbidden.contains(&offset)).then(|| (OpIndex::new(at), offset))
        };
        Self { allowed: program.ops.iter().enumerate().filter_map(may).collect() }
    }

    /// Notes the products of an operation, or recomputes its sums with products that are not
    /// rounded.
    pub(super) fn after<const W: usize>(
        &self,
        choices: &OpenChoices,
        op: OpIndex,
        executed: &Op,
        live: &mut LiveProducts,
        batch: &mut Batch<W>,
    ) {
        match executed {
            Op::LaneKernel { kernel, to, from } if self.allowed.contains_key(&op) => {
                let (to, from, offset) = (*to, [from[0], from[1]], self.allowed[&op]);
                if kernel.name == "FMul" {
                    live.by_register.insert(to, Products::of(batch, to, from));
                } else {
                    let sum = Sum { op, offset, is_difference: kernel.name == "FSub", to, from };
                    sum.contract(choices, live, batch);
                }
            }
            Op::Memory(MemoryOp::Move { to, from } | MemoryOp::MoveMasked { to, from }) => {
                match live.by_register.get(from).cloned() {
                    Some(products) => live.by_register.insert(*to, products),
                    None => live.by_register.remove(to),
                };
            }
            _ => {}
        }
    }
}

impl Products {
    fn of<const W: usize>(batch: &Batch<W>, to: Reg, from: [Reg; 2]) -> Self {
        let float = |register: Reg, lane: usize| f32::from_bits(batch.registers[register].0[lane]);
        let factors = (0..W).map(|lane| from.map(|register| float(register, lane))).collect();
        Self { factors, rounded: batch.registers[to].0.to_vec() }
    }
}

/// A sum or difference that was executed.
#[derive(Clone, Copy, Debug)]
struct Sum {
    op: OpIndex,
    /// The words of its instruction.
    offset: u32,
    is_difference: bool,
    to: Reg,
    from: [Reg; 2],
}

impl Sum {
    /// Recomputes it, if that is drawn, in the lanes where an operand is a product.
    fn contract<const W: usize>(&self, choices: &OpenChoices, live: &LiveProducts, batch: &mut Batch<W>) {
        let [first, second] = self.from.map(|register| live.by_register.get(&register));
        if first.is_none() && second.is_none() {
            return;
        }
        // An instruction is contracted in all invocations and components, or in none.
        let place = u64::from(choices.shader.0) << 32 | u64::from(self.offset);
        let site = choices.site(ChoiceKind::Contraction, [0; 3], place);
        // Of two products one at most is left unrounded.
        let Some(which) = choices.draw(site).map(|mut random| random.below(3)) else { return };
        let (at, products) = match (which, first, second) {
            (0, Some(products), _) => (0, products),
            (1, _, Some(products)) => (1, products),
            _ => return,
        };
        let sign = |negated: bool| if negated { -1.0 } else { 1.0 };
        let signs = [sign(self.is_difference && at == 1), sign(self.is_difference && at == 0)];
        let mut differs = false;
        for lane in batch.mask.lanes() {
            let word = |register: Reg| batch.registers[register].0[lane];
            if word(self.from[at]) != products.rounded[lane] {
                continue;
            }
            let other = f32::from_bits(word(self.from[1 - at]));
            let [a, b] = products.factors[lane];
            let fused = (signs[0] * a).mul_add(b, signs[1] * other);
            differs |= fused.to_bits() != word(self.to);
            batch.registers[self.to].0[lane] = fused.to_bits();
        }
        if differs {
            let details = || DrawnDetails::Value { shader: choices.shader, op: Some(self.op), id: 0 };
            choices.note(site, details);
        }
    }
}

/// The words of the instructions that must not be contracted: those decorated `NoContraction`, and
/// with `FloatControls2` those whose fast-math mode, their own or that of the entry point, has no
/// `AllowContract`.
fn forbidden(program: &Program) -> FxHashSet<u32> {
    let module = &program.module;
    let mut forbidden: FxHashSet<u32> = no_contraction(module).into_iter().collect();
    if !module.capabilities.contains(&FLOAT_CONTROLS2) {
        return forbidden;
    }
    let default = default_mode(program);
    let blocks = module.functions.iter().flat_map(|function| &function.blocks);
    for one in blocks.flat_map(|block| &block.instructions) {
        let Some(id) = one.result else { continue };
        let own = module.decorations.literal(id, FP_FAST_MATH_MODE).map(u64::from);
        if own.or(default).is_some_and(|mode| mode & ALLOW_CONTRACT == 0) {
            forbidden.insert(one.offset);
        }
    }
    forbidden
}

/// The fast-math mode that the entry point sets for 32-bit floats, if it does.
fn default_mode(program: &Program) -> Option<u64> {
    let module = &program.module;
    let mut entries = module.entry_points.iter();
    let entry = entries.find(|entry| entry.stage == program.stage && entry.name == program.name)?;
    entry.modes.iter().find_map(|(number, operands)| {
        let &[ty, mode] = &operands[..] else { return None };
        let ty = (*number == FP_FAST_MATH_DEFAULT).then(|| module.type_with_id(Id(ty)))??;
        let is_single = matches!(module.ty(ty), Type::Float { width: 32, .. });
        is_single.then(|| module.scalar_value(Id(mode))).flatten()
    })
}
