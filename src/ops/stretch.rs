//! Stretches of regular operations, run without leaving one loop.
//!
//! Most of what a shader does are some sixty regular instructions on 32-bit values, and moves. A
//! [`Step`] names one of them by a number, and its loop over the lanes stands in the arm of one
//! `match`, compiled for the processor's vectors as a whole: from one operation to the next it is a
//! jump, not a call. Where an operation's result goes into the next one alone, the frequent pairs
//! have a number together, and the value between them stays in a vector register; each of the two
//! rounds as it does by itself. Other regular operations are called as ever, and irregular ones end
//! a stretch.

use std::collections::HashMap;
use std::marker::PhantomData;

use crate::machine::lanes::{map2, map3};
use crate::machine::{Mask, Reg, Registers};
use crate::ops::conversion::{self, Between, Conversion};
use crate::ops::memory;
use crate::ops::op::Op;
use crate::ops::relational_logical::select;
use crate::ops::row::{Binary, Bits, LaneLoop, Row, Unary, Width};
use crate::ops::{arithmetic, bit, glsl, relational_logical as logical};

/// An operation of a program as a stretch runs it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    kind: Kind,
    /// How many operations on the next step is.
    next: u8,
    to: Reg,
    from: [Reg; 3],
}

/// `F(a, b)`, then `G(that, c)`.
struct Then<F, G>(PhantomData<(F, G)>);

impl<F: Binary, G: Binary<A = F::R>> LaneLoop for Then<F, G> {
    #[inline(always)]
    fn run<const W: usize>(registers: &mut Registers<W>, to: Reg, from: &[Reg; 3]) {
        map3::<W, F::A, F::B, G::B, G::R>(registers, to, from, |a, b, c| G::apply(F::apply(a, b), c));
    }
}

/// `F(a, b)`, then `G(c, that)`.
struct After<F, G>(PhantomData<(F, G)>);

impl<F: Binary, G: Binary<B = F::R>> LaneLoop for After<F, G> {
    #[inline(always)]
    fn run<const W: usize>(registers: &mut Registers<W>, to: Reg, from: &[Reg; 3]) {
        map3::<W, F::A, F::B, G::A, G::R>(registers, to, from, |a, b, c| G::apply(c, F::apply(a, b)));
    }
}

/// `F(a)`, then `G(that, b)`.
struct ThenWith<F, G>(PhantomData<(F, G)>);

impl<F: Unary, G: Binary<A = F::R>> LaneLoop for ThenWith<F, G> {
    #[inline(always)]
    fn run<const W: usize>(registers: &mut Registers<W>, to: Reg, from: &[Reg; 3]) {
        map2::<W, F::A, G::B, G::R>(registers, to, from, |a, b| G::apply(F::apply(a), b));
    }
}

/// `F(a, b)`, then `G(that)`.
struct ThenOne<F, G>(PhantomData<(F, G)>);

impl<F: Binary, G: Unary<A = F::R>> LaneLoop for ThenOne<F, G> {
    #[inline(always)]
    fn run<const W: usize>(registers: &mut Registers<W>, to: Reg, from: &[Reg; 3]) {
        map2::<W, F::A, F::B, G::R>(registers, to, from, |a, b| G::apply(F::apply(a, b)));
    }
}

macro_rules! kinds {
    (
        rows { $($name:ident $section:ident $ty:ident,)* }
        conversions { $($conversion:ident $from:ident $into:ident,)* }
        pairs { $($pair:ident $shape:ident $first:ident $first_type:ty, $second:ident $second_type:ty;)* }
    ) => {
        /// Which operation.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        enum Kind {
            /// Ends a stretch.
            Other,
            /// Does nothing.
            Idle,
            /// A row without a number.
            Row,
            Move,
            MoveMasked,
            $($name,)*
            $($conversion,)*
            $($pair,)*
        }

        impl Kind {
            /// The rows that have a number.
            fn numbered() -> Vec<(&'static Row, Self)> {
                let families = [$(($section::$name.row(<$ty as Bits>::BITS), Self::$name)),*];
                let conversions = [$((
                    conversion::row(Conversion::$conversion, <$from as Bits>::BITS, <$into as Bits>::BITS),
                    Self::$conversion,
                )),*];
                let all = families.into_iter().chain(conversions);
                all.filter_map(|(row, kind)| Some((row?, kind))).collect()
            }

            /// The pairs that have a number: both kinds, and how they hang together.
            const PAIRS: &'static [(Self, Self, Shape, Self)] =
                &[$((Self::$first, Self::$second, Shape::$shape, Self::$pair)),*];
        }

        /// Runs the steps of a stretch; how many operations there were before one that is irregular.
        #[inline(always)]
        fn run_steps(
            registers: &mut Registers<32>,
            (steps, ops): (&[Step], &[Op]),
            mask: Mask<32>,
        ) -> usize {
            let mut at = 0;
            while let Some(Step { kind, next, to, from }) = steps.get(at) {
                match kind {
                    Kind::Other => return at,
                    Kind::Idle => {}
                    Kind::Row => {
                        if let Op::Row { row, to, from } = &ops[at] {
                            Width::<32>::run(*row, registers, *to, from);
                        }
                    }
                    Kind::Move => registers.copy(*to, from[0], Mask::ALL),
                    Kind::MoveMasked => registers.copy(*to, from[0], mask),
                    $(Kind::$name => $section::$name::<$ty>::run(registers, *to, from),)*
                    $(Kind::$conversion => Between::<$from, $into>::run(registers, *to, from),)*
                    $(Kind::$pair => $shape::<$first_type, $second_type>::run(registers, *to, from),)*
                }
                at += usize::from(*next);
            }
            steps.len()
        }
    };
}

/// How the operations of a pair hang together: see the types of these names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    Then,
    After,
    ThenWith,
    ThenOne,
}

kinds! {
    rows {
    SNegate arithmetic i32, IAdd arithmetic u32, ISub arithmetic u32, IMul arithmetic u32,
    FNegate arithmetic f32, FAdd arithmetic f32, FSub arithmetic f32, FMul arithmetic f32,
    FDiv arithmetic f32,
    ShiftRightLogical bit u32, ShiftRightArithmetic bit i32, ShiftLeftLogical bit u32, BitwiseOr bit u32,
    BitwiseXor bit u32, BitwiseAnd bit u32, Not bit u32,
    LogicalEqual logical bool, LogicalNotEqual logical bool, LogicalOr logical bool,
    LogicalAnd logical bool, LogicalNot logical bool,
    IEqual logical u32, INotEqual logical u32, UGreaterThan logical u32, SGreaterThan logical i32,
    UGreaterThanEqual logical u32, SGreaterThanEqual logical i32, ULessThan logical u32,
    SLessThan logical i32, ULessThanEqual logical u32, SLessThanEqual logical i32,
    FOrdEqual logical f32, FOrdNotEqual logical f32, FUnordNotEqual logical f32,
    FOrdLessThan logical f32, FOrdGreaterThan logical f32, FOrdLessThanEqual logical f32,
    FOrdGreaterThanEqual logical f32, IsNan logical f32,
    SelectWord select bool,
    FAbs glsl f32, Trunc glsl f32, Floor glsl f32, Ceil glsl f32, Fract glsl f32, FMin glsl f32,
    UMin glsl u32, SMin glsl i32, FMax glsl f32, UMax glsl u32, SMax glsl i32, FClamp glsl f32,
    FMix glsl f32, Step glsl f32, SmoothStep glsl f32, Sqrt glsl f32, Fma glsl f32, NMin glsl f32,
    NMax glsl f32, NClamp glsl f32,
    }
    conversions {
    FToU f32 u32, FToS f32 i32, SToF i32 f32, UToF u32 f32,
    }
    pairs {
    MulAdd Then FMul arithmetic::FMul<f32>, FAdd arithmetic::FAdd<f32>;
    AddMul After FMul arithmetic::FMul<f32>, FAdd arithmetic::FAdd<f32>;
    MulSub Then FMul arithmetic::FMul<f32>, FSub arithmetic::FSub<f32>;
    SubMul After FMul arithmetic::FMul<f32>, FSub arithmetic::FSub<f32>;
    MulMul Then FMul arithmetic::FMul<f32>, FMul arithmetic::FMul<f32>;
    TimesMul After FMul arithmetic::FMul<f32>, FMul arithmetic::FMul<f32>;
    TimesAdd After FAdd arithmetic::FAdd<f32>, FMul arithmetic::FMul<f32>;
    TimesSub After FSub arithmetic::FSub<f32>, FMul arithmetic::FMul<f32>;
    PlusAdd After FAdd arithmetic::FAdd<f32>, FAdd arithmetic::FAdd<f32>;
    AddThenMul Then FAdd arithmetic::FAdd<f32>, FMul arithmetic::FMul<f32>;
    SubThenMul Then FSub arithmetic::FSub<f32>, FMul arithmetic::FMul<f32>;
    AddAdd Then FAdd arithmetic::FAdd<f32>, FAdd arithmetic::FAdd<f32>;
    SubAdd Then FSub arithmetic::FSub<f32>, FAdd arithmetic::FAdd<f32>;
    UnsignedTimes ThenWith UToF Between<u32, f32>, FMul arithmetic::FMul<f32>;
    SignedTimes ThenWith SToF Between<i32, f32>, FMul arithmetic::FMul<f32>;
    ShiftUToF ThenOne ShiftRightLogical bit::ShiftRightLogical<u32>, UToF Between<u32, f32>;
    ShiftXor Then ShiftRightLogical bit::ShiftRightLogical<u32>, BitwiseXor bit::BitwiseXor<u32>;
    ShiftLeftXor Then ShiftLeftLogical bit::ShiftLeftLogical<u32>, BitwiseXor bit::BitwiseXor<u32>;
    ShiftAnd Then ShiftRightLogical bit::ShiftRightLogical<u32>, BitwiseAnd bit::BitwiseAnd<u32>;
    ShiftLeftOr Then ShiftLeftLogical bit::ShiftLeftLogical<u32>, BitwiseOr bit::BitwiseOr<u32>;
    ShiftOr Then ShiftRightLogical bit::ShiftRightLogical<u32>, BitwiseOr bit::BitwiseOr<u32>;
    XorTimes Then BitwiseXor bit::BitwiseXor<u32>, IMul arithmetic::IMul<u32>;
    XorXor Then BitwiseXor bit::BitwiseXor<u32>, BitwiseXor bit::BitwiseXor<u32>;
    TimesPlus Then IMul arithmetic::IMul<u32>, IAdd arithmetic::IAdd<u32>;
    PlusPlus Then IAdd arithmetic::IAdd<u32>, IAdd arithmetic::IAdd<u32>;
    PlusTimes Then IAdd arithmetic::IAdd<u32>, IMul arithmetic::IMul<u32>;
    }
}

/// Whether operands may change places: of integers, as of two NaNs the first is kept.
fn commutes(kind: Kind) -> bool {
    matches!(kind, Kind::IAdd | Kind::IMul | Kind::BitwiseXor | Kind::BitwiseAnd | Kind::BitwiseOr)
}

/// The steps of a program's operations, one each. `passes` says of an operation whether its result
/// goes into the next one that is not idle, once, and nowhere else.
pub fn steps(ops: &[Op], passes: &[bool]) -> Vec<Step> {
    let numbered: HashMap<*const Row, Kind> =
        Kind::numbered().into_iter().map(|(row, kind)| (std::ptr::from_ref(row), kind)).collect();
    let step = |op: &Op| {
        let (kind, to, from) = match op {
            Op::Row { row, to, from } => {
                let known = numbered.get(&std::ptr::from_ref(*row));
                (known.copied().unwrap_or(Kind::Row), *to, *from)
            }
            Op::Memory(memory::Op::Move { to, from }) if to == from => (Kind::Idle, *to, [*from; 3]),
            Op::Memory(memory::Op::Move { to, from }) => (Kind::Move, *to, [*from; 3]),
            Op::Memory(memory::Op::MoveMasked { to, from }) => (Kind::MoveMasked, *to, [*from; 3]),
            _ => (Kind::Other, Reg(0), [Reg(0); 3]),
        };
        Step { kind, next: 1, to, from }
    };
    let mut steps: Vec<Step> = ops.iter().map(step).collect();
    // Idle steps are left out.
    for at in (1..steps.len()).rev() {
        let Step { kind, next, .. } = steps[at];
        let before = &mut steps[at - 1];
        if kind == Kind::Idle
            && let Some(sum) = before.next.checked_add(next)
        {
            before.next = sum;
        }
    }
    let mut at = 0;
    while at < steps.len() {
        let next = at + usize::from(steps[at].next);
        let pair = steps.get(next).filter(|_| passes[at]).and_then(|second| pair(&steps[at], second));
        if let Some(pair) = pair {
            steps[at] = pair;
        }
        at += usize::from(steps[at].next);
    }
    steps
}

/// Two steps as one, where they have a number together and the first one's result goes nowhere else.
fn pair(first: &Step, second: &Step) -> Option<Step> {
    let next = first.next.checked_add(second.next)?;
    let [a, b, _] = first.from;
    let Step { kind, to, from: [c, d, _], .. } = *second;
    let found = |wanted: &[Shape]| {
        let mut pairs = Kind::PAIRS.iter();
        pairs.find(|known| known.0 == first.kind && known.1 == kind && wanted.contains(&known.2))
    };
    let both = c == first.to && d == first.to;
    let (known, from) = match found(&[Shape::ThenOne]) {
        Some(known) if c == first.to => (known, [a, b, a]),
        _ if both => return None,
        _ if c == first.to => match found(&[Shape::Then, Shape::ThenWith])? {
            known if known.2 == Shape::Then => (known, [a, b, d]),
            known => (known, [a, d, a]),
        },
        _ if d == first.to => match found(&[Shape::After]) {
            Some(known) => (known, [a, b, c]),
            None if commutes(kind) => (found(&[Shape::Then])?, [a, b, c]),
            None => return None,
        },
        _ => return None,
    };
    Some(Step { kind: known.3, next, to, from })
}

/// Runs steps from the first on, which those operations are, with what the processor has; how many
/// operations there were before one that is irregular.
#[inline]
pub fn run(registers: &mut Registers<32>, steps: &[Step], ops: &[Op], mask: Mask<32>) -> usize {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = registers.simd() {
        return simd.vectorize(Wide { registers, steps, ops, mask });
    }
    run_steps(registers, (steps, ops), mask)
}

/// The loop with its arguments, to be compiled for AVX2.
#[cfg(target_arch = "x86_64")]
struct Wide<'a> {
    registers: &'a mut Registers<32>,
    steps: &'a [Step],
    ops: &'a [Op],
    mask: Mask<32>,
}

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for Wide<'_> {
    type Output = usize;

    #[inline(always)]
    fn call(self) -> usize {
        run_steps(self.registers, (self.steps, self.ops), self.mask)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPECIAL: [u32; 8] =
        [0, 0x8000_0000, 0x3F80_0001, 0xC120_0000, 1, 0x7F7F_FFFF, 0x7F80_0000, 0x0000_4321];

    /// Row 0 to 2 hold special numbers, in every combination over the lanes of several rounds.
    fn registers(round: u32) -> Registers<32> {
        let mut registers = Registers::new(8);
        for operand in 0..3u32 {
            for lane in 0..32u32 {
                let pick = (round * 32 + lane) >> (3 * operand) & 7;
                registers[Reg(operand)].0[lane as usize] = SPECIAL[pick as usize];
            }
        }
        registers
    }

    /// What two operations leave in row 4, as one step or as two.
    fn result(ops: &[Op], passes: bool, round: u32) -> [u32; 32] {
        let steps = steps(ops, &[passes, false]);
        assert_eq!(usize::from(steps[0].next), if passes { 2 } else { 1 });
        let mut registers = registers(round);
        assert_eq!(run(&mut registers, &steps, ops, Mask::ALL), ops.len());
        registers[Reg(4)].0
    }

    #[test]
    fn a_pair_is_its_two_operations() {
        let rows: HashMap<Kind, &'static Row> =
            Kind::numbered().into_iter().map(|(row, kind)| (kind, row)).collect();
        let mut count = 0;
        for &(first, second, shape, _) in Kind::PAIRS {
            let (first, second) = (rows[&first], rows[&second]);
            let reads = match shape {
                Shape::Then | Shape::ThenWith => vec![[3, 2]],
                Shape::After => vec![[2, 3]],
                Shape::ThenOne => vec![[3, 3]],
            };
            for [c, d] in reads {
                let ops = [
                    Op::Row { row: first, to: Reg(3), from: [Reg(0), Reg(1), Reg(0)] },
                    Op::Row { row: second, to: Reg(4), from: [Reg(c), Reg(d), Reg(c)] },
                ];
                for round in 0..16 {
                    assert_eq!(
                        result(&ops, true, round),
                        result(&ops, false, round),
                        "{first:?} {second:?} {shape:?}"
                    );
                    count += 1;
                }
            }
        }
        assert!(count > 0);
    }

    #[test]
    fn every_numbered_row_is_there_once() {
        let numbered = Kind::numbered();
        assert!(numbered.len() > 60, "{}", numbered.len());
        let kinds: std::collections::HashSet<Kind> = numbered.iter().map(|&(_, kind)| kind).collect();
        assert_eq!(kinds.len(), numbered.len());
    }

    #[test]
    fn a_stretch_ends_before_an_irregular_operation_and_leaves_idle_ones_out() {
        let copy = |to, from| Op::Memory(memory::Op::Move { to: Reg(to), from: Reg(from) });
        let ops = [copy(5, 0), copy(1, 1), copy(2, 2), copy(6, 5), Op::Barrier, copy(7, 6)];
        let steps = steps(&ops, &[false; 6]);
        assert_eq!(steps[0].next, 3);
        let mut registers = registers(0);
        assert_eq!(run(&mut registers, &steps, &ops, Mask::ALL), 4);
        assert_eq!(registers[Reg(6)], registers[Reg(0)]);
        assert_eq!(registers[Reg(7)].0, [0; 32]);
    }
}
