//! Lane kernels: the regular instructions, each a scalar function applied to every component and
//! lane.
//!
//! A [`LaneKernel`] is one instruction at one width. The `lane_kernels!`
//! macro writes an [`OpFamily`], the instruction at all its widths, from one closure.

use std::fmt;
use std::sync::LazyLock;

#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;

use crate::machine::lanes::Lanes;
use crate::machine::{Mask, Reg, Registers, Scalar};
use crate::math::lane_ops::CpuTier;
use crate::module::opcode_table::OpcodeTable;

/// Runs a kernel over all lanes of a batch.
pub type Eval<const W: usize> = fn(&mut [Lanes<W>], Reg, &[Reg; 3]);

/// Runs a kernel over 64 lanes: on x86-64 compiled for processors with AVX2.
#[cfg(target_arch = "x86_64")]
pub type Eval64 = fn(V3, &mut [Lanes<64>], Reg, &[Reg; 3]);

/// Runs a kernel over 64 lanes.
#[cfg(not(target_arch = "x86_64"))]
pub type Eval64 = Eval<64>;

/// The instruction set to which an instruction's number belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum InstructionSet {
    /// SPIR-V's own opcodes.
    Core,
    /// `GLSL.std.450`.
    Glsl,
    /// Kernels that are no instructions by themselves: parts of the translation of others.
    Internal,
}

/// One instruction at one width.
pub struct LaneKernel {
    /// The specification's name, without `Op`.
    pub name: &'static str,
    /// The instruction at all its widths.
    pub family: &'static OpFamily,
    /// Bits of the operand that selects the kernel; 0 where there is only one.
    pub width: u32,
    /// Words of the result.
    pub words: u32,
    /// Words of each operand; 0 for operands that it does not have.
    pub operands: [u32; 3],
    /// Bits of each operand that is a float; else 0.
    pub float_operands: [u32; 3],
    /// Bits of the result where it is a float; else 0.
    pub float_result: u32,
    /// Whether the operand that selects the kernel is a signed integer.
    pub signed: bool,
    /// The kernel for batches of one lane.
    pub eval_1: Eval<1>,
    /// The kernel for eight lanes of a batch.
    pub eval_8: Eval<8>,
    /// The kernel for batches of 64 lanes, where all values have 32 or 64 bits. Kernels of narrower
    /// values are rare: they run eight lanes at a time, as does every kernel on a processor without
    /// AVX2, so that they need not be compiled once more.
    pub eval_64: Option<Eval64>,
}

impl fmt::Debug for LaneKernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.name, self.width)
    }
}

impl PartialEq for LaneKernel {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

/// Runs a kernel in batches of `W` lanes, with the vector extensions of the processor.
pub trait Width<const W: usize> {
    /// Writes the result's registers for every lane.
    fn run(&self, registers: &mut Registers<W>, to: Reg, from: &[Reg; 3]);

    /// Whether batches of this width run superinstructions on this CPU.
    fn has_superops(_: &Registers<W>) -> bool {
        false
    }

    /// A batch of 64 lanes as such, to run superinstructions; no other has any.
    #[inline(always)]
    fn as_64(_: &mut Registers<W>, _: Mask<W>) -> Option<(&mut Registers<64>, Mask<64>)> {
        None
    }
}

impl Width<1> for LaneKernel {
    #[inline]
    fn run(&self, registers: &mut Registers<1>, to: Reg, from: &[Reg; 3]) {
        (self.eval_1)(registers.all_mut(), to, from);
    }
}

impl Width<64> for LaneKernel {
    #[inline]
    fn run(&self, registers: &mut Registers<64>, to: Reg, from: &[Reg; 3]) {
        self.run_64(registers.cpu_tier(), registers.all_mut(), to, from);
    }

    #[inline]
    fn has_superops(registers: &Registers<64>) -> bool {
        registers.cpu_tier().is_wide()
    }

    #[inline(always)]
    fn as_64(registers: &mut Registers<64>, mask: Mask<64>) -> Option<(&mut Registers<64>, Mask<64>)> {
        Some((registers, mask))
    }
}

/// For subgroups of 128, which are rare: two runs of 64 lanes, so that kernels need not be compiled
/// for this width.
impl Width<128> for LaneKernel {
    fn run(&self, registers: &mut Registers<128>, to: Reg, from: &[Reg; 3]) {
        let cpu_tier = registers.cpu_tier();
        self.run_in_parts(registers.all_mut(), to, from, |part, to, from| {
            self.run_64(cpu_tier, part, to, from)
        });
    }
}

impl LaneKernel {
    /// Whether it is the instruction of a family at some width.
    #[inline]
    pub fn is(&self, family: &OpFamily) -> bool {
        self.family == family
    }

    /// Whether it is the instruction of one of these families.
    pub fn is_one_of(&self, families: &[&OpFamily]) -> bool {
        families.contains(&self.family)
    }

    #[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables, reason = "AVX2 is of x86-64"))]
    #[inline]
    fn run_64(&self, cpu_tier: CpuTier, registers: &mut [Lanes<64>], to: Reg, from: &[Reg; 3]) {
        if let Some(full) = self.eval_64 {
            #[cfg(target_arch = "x86_64")]
            if let Some(simd) = cpu_tier.avx2() {
                return full(simd, registers, to, from);
            }
            #[cfg(not(target_arch = "x86_64"))]
            return full(registers, to, from);
        }
        self.run_in_parts(registers, to, from, self.eval_8);
    }

    /// Runs the kernel over registers of `W` lanes, `PART` lanes at a time: no lane's result
    /// depends on another lane.
    #[inline(never)]
    fn run_in_parts<const W: usize, const PART: usize>(
        &self,
        registers: &mut [Lanes<W>],
        to: Reg,
        from: &[Reg; 3],
        run: impl Fn(&mut [Lanes<PART>], Reg, &[Reg; 3]),
    ) {
        const OPERANDS: [Reg; 3] = [Reg(2), Reg(4), Reg(6)];
        let mut part = [Lanes::<PART>::splat(0); 8];
        for first in (0..W).step_by(PART) {
            let lanes = first..first + PART;
            for ((&operand, &words), &own) in from.iter().zip(&self.operands).zip(&OPERANDS) {
                for word in 0..words {
                    let operand = &registers[operand.plus(word).0 as usize];
                    part[own.plus(word).0 as usize].0.copy_from_slice(&operand.0[lanes.clone()]);
                }
            }
            run(&mut part, Reg(0), &OPERANDS);
            for (word, result) in (0..self.words).zip(&part) {
                registers[to.plus(word).0 as usize].0[lanes.clone()].copy_from_slice(&result.0);
            }
        }
    }
}

/// A call of a kernel's function, to be compiled for AVX2. The results do not depend on the
/// processor, as no operations are fused or reordered.
#[cfg(target_arch = "x86_64")]
#[doc(hidden)]
#[derive(Debug)]
pub struct VectorizedCall<'a, F> {
    pub registers: &'a mut [Lanes<64>],
    pub to: Reg,
    pub from: &'a [Reg; 3],
    pub function: F,
}

#[cfg(target_arch = "x86_64")]
impl<F: Fn(&mut [Lanes<64>], Reg, &[Reg; 3])> pulp::NullaryFnOnce for VectorizedCall<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        (self.function)(self.registers, self.to, self.from);
    }
}

/// An instruction at all its widths.
#[derive(Debug)]
pub struct OpFamily {
    /// The specification's name, without `Op`.
    pub name: &'static str,
    /// The set to which the number belongs.
    pub set: InstructionSet,
    /// The opcode or extended instruction number.
    pub number: u32,
    /// The kernels, one for each width.
    pub kernels: &'static [LaneKernel],
}

impl PartialEq for OpFamily {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl OpFamily {
    /// The kernel for operands of a width.
    #[inline]
    pub fn kernel(&'static self, width: u32) -> Option<&'static LaneKernel> {
        self.kernels.iter().find(|kernel| kernel.width == width || kernel.width == 0)
    }
}

/// The family of an instruction's number.
#[inline]
pub fn family(set: InstructionSet, number: u32) -> Option<&'static OpFamily> {
    static TABLES: LazyLock<[OpcodeTable<&'static OpFamily>; 2]> = LazyLock::new(|| {
        [InstructionSet::Core, InstructionSet::Glsl].map(|set| {
            let sections = crate::ops::SECTIONS.iter().flat_map(|section| section.iter().copied());
            let families = sections.filter(|family| family.set == set);
            families.filter_map(|family| Some((u16::try_from(family.number).ok()?, family))).collect()
        })
    });
    let [core, glsl] = &*TABLES;
    match set {
        InstructionSet::Core => core.get(number as usize).copied(),
        InstructionSet::Glsl => glsl.get(number as usize).copied(),
        InstructionSet::Internal => None,
    }
}

/// Defines families of kernels.
///
/// ```text
/// lane_kernels! { FAdd Core [f16 f32 f64] (a: T, b: T) -> T { a + b } }
/// ```
/// In the body, `T` is the type of the kernel. The macro defines a `static FAdd: OpFamily` for each
/// instruction, and the list `FAMILIES`.
macro_rules! lane_kernels {
    ($($(#[$doc:meta])* $name:ident $set:ident [$($ty:ty)*] $args:tt -> $result:ty $body:block)*) => {
        $(
            $(#[$doc])*
            #[allow(non_upper_case_globals)]
            #[doc = concat!("`", stringify!($name), "` at all its widths.")]
            pub static $name: $crate::ops::lane_kernel::OpFamily = $crate::ops::lane_kernel::OpFamily {
                name: stringify!($name),
                set: $crate::ops::lane_kernel::InstructionSet::$set,
                number: $crate::ops::lane_kernel::number!($set, $name),
                kernels: &[$($crate::ops::lane_kernel::lane_kernel!($name, &$name, $ty, $args, $result, $name<$ty>)),*],
            };
            #[doc = concat!("The lane loop of `", stringify!($name), "` on a type.")]
            pub(crate) struct $name<T> {
                _type: std::marker::PhantomData<T>,
            }
            $($crate::ops::lane_kernel::lane_loop!($name, $ty, $args, $result, $body);)*
        )*
        /// The families of this section.
        #[allow(dead_code, reason = "families within a function are named by it, one by one")]
        pub(crate) static FAMILIES: &[&$crate::ops::lane_kernel::OpFamily] = &[$(&$name),*];
    };
}
pub(crate) use lane_kernels;

/// The number of an instruction, from its name.
#[doc(hidden)]
macro_rules! number {
    (Core, $name:ident) => {
        $crate::module::Opcode::$name.0 as u32
    };
    (Glsl, $name:ident) => {
        rspirv::spirv::GlslStd450Op::$name as u32
    };
    (Internal, $name:ident) => {
        u32::MAX
    };
}
pub(crate) use number;

/// The lane loop of a kernel, implemented for the type that names its family.
pub trait LaneLoop {
    /// Writes the result's registers for every lane.
    fn run<const W: usize>(registers: &mut [Lanes<W>], to: Reg, from: &[Reg; 3]);
}

/// The scalar function of a kernel of one operand.
pub trait Unary {
    /// The operand.
    type A: Scalar;
    /// The result.
    type R: Scalar;
    /// The value for one lane.
    fn apply(a: Self::A) -> Self::R;
}

/// The scalar function of a kernel of two operands.
pub trait Binary {
    /// The first operand.
    type A: Scalar;
    /// The second operand.
    type B: Scalar;
    /// The result.
    type R: Scalar;
    /// The value for one lane.
    fn apply(a: Self::A, b: Self::B) -> Self::R;
}

/// The scalar function of a kernel of three operands.
pub trait Ternary {
    /// The first operand.
    type A: Scalar;
    /// The second operand.
    type B: Scalar;
    /// The third operand.
    type C: Scalar;
    /// The result.
    type R: Scalar;
    /// The value for one lane.
    fn apply(a: Self::A, b: Self::B, c: Self::C) -> Self::R;
}

/// The lane loop of one kernel of `lane_kernels!`.
#[doc(hidden)]
macro_rules! lane_loop {
    ($name:ident, $ty:ty, $args:tt, $result:ty, $body:block) => {
        const _: () = {
            #[allow(dead_code)]
            type T = $ty;
            $crate::ops::lane_kernel::lane_loop!(@ $name<$ty>, $args, $result, $body);
        };
    };
    (@ $name:ty, ($a:ident: $at:ty), $result:ty, $body:block) => {
        impl $crate::ops::lane_kernel::Unary for $name {
            type A = $at;
            type R = $result;

            #[inline(always)]
            fn apply($a: $at) -> $result {
                $body
            }
        }
        $crate::ops::lane_kernel::lane_loop!(@ $name, [$at, $result], map1, <$name as $crate::ops::lane_kernel::Unary>::apply);
    };
    (@ $name:ty, ($a:ident: $at:ty, $b:ident: $bt:ty), $result:ty, $body:block) => {
        impl $crate::ops::lane_kernel::Binary for $name {
            type A = $at;
            type B = $bt;
            type R = $result;

            #[inline(always)]
            fn apply($a: $at, $b: $bt) -> $result {
                $body
            }
        }
        $crate::ops::lane_kernel::lane_loop!(@ $name, [$at, $bt, $result], map2, <$name as $crate::ops::lane_kernel::Binary>::apply);
    };
    (@ $name:ty, ($a:ident: $at:ty, $b:ident: $bt:ty, $c:ident: $ct:ty), $result:ty, $body:block) => {
        impl $crate::ops::lane_kernel::Ternary for $name {
            type A = $at;
            type B = $bt;
            type C = $ct;
            type R = $result;

            #[inline(always)]
            fn apply($a: $at, $b: $bt, $c: $ct) -> $result {
                $body
            }
        }
        $crate::ops::lane_kernel::lane_loop!(@ $name, [$at, $bt, $ct, $result], map3, <$name as $crate::ops::lane_kernel::Ternary>::apply);
    };
    (@ $name:ty, [$($ty:ty),*], $map:ident, $function:expr) => {
        impl $crate::ops::lane_kernel::LaneLoop for $name {
            #[inline(always)]
            fn run<const W: usize>(
                registers: &mut [$crate::machine::lanes::Lanes<W>],
                to: $crate::machine::Reg,
                from: &[$crate::machine::Reg; 3],
            ) {
                $crate::machine::lanes::$map::<W, $($ty),*>(registers, to, from, $function);
            }
        }
    };
}
pub(crate) use lane_loop;

/// One kernel of `lane_kernels!`, with its
/// [`LaneLoop`](crate::ops::lane_kernel::LaneLoop).
#[doc(hidden)]
macro_rules! lane_kernel {
    ($name:ident, $family:expr, $ty:ty, ($($a:ident: $at:ty),*), $result:ty, $lanes:ty) => {{
        #[allow(dead_code)]
        type T = $ty;
        fn eval<const W: usize>(
            registers: &mut [$crate::machine::lanes::Lanes<W>],
            to: $crate::machine::Reg,
            from: &[$crate::machine::Reg; 3],
        ) {
            <$lanes as $crate::ops::lane_kernel::LaneLoop>::run(registers, to, from);
        }
        #[cfg(target_arch = "x86_64")]
        fn eval_64(
            simd: pulp::x86::V3,
            registers: &mut [$crate::machine::lanes::Lanes<64>],
            to: $crate::machine::Reg,
            from: &[$crate::machine::Reg; 3],
        ) {
            let function = <$lanes as $crate::ops::lane_kernel::LaneLoop>::run::<64>;
            simd.vectorize($crate::ops::lane_kernel::VectorizedCall { registers, to, from, function });
        }
        #[cfg(not(target_arch = "x86_64"))]
        use eval as eval_64;
        $crate::ops::lane_kernel::LaneKernel {
            name: stringify!($name),
            family: $family,
            width: <$ty as $crate::ops::lane_kernel::ScalarWidth>::BITS,
            words: <$result as $crate::machine::Scalar>::WORDS,
            operands: $crate::ops::lane_kernel::operands(&[$(<$at as $crate::machine::Scalar>::WORDS),*]),
            float_operands: $crate::ops::lane_kernel::operands(&[$(<$at as $crate::ops::lane_kernel::ScalarWidth>::FLOAT),*]),
            float_result: <$result as $crate::ops::lane_kernel::ScalarWidth>::FLOAT,
            signed: <$ty as $crate::ops::lane_kernel::ScalarWidth>::SIGNED,
            eval_1: eval::<1>,
            eval_8: eval::<8>,
            eval_64: if $crate::ops::lane_kernel::has_no_narrow(&[
                $(<$at as $crate::ops::lane_kernel::ScalarWidth>::BITS,)*
                <$result as $crate::ops::lane_kernel::ScalarWidth>::BITS,
            ]) {
                Some(eval_64)
            } else {
                None
            },
        }
    }};
}
pub(crate) use lane_kernel;

/// The width that selects a kernel; `bool` has none.
pub trait ScalarWidth {
    /// Bits, 0 for a bool.
    const BITS: u32;
    /// Bits of a float, else 0.
    const FLOAT: u32;
    /// Whether it is a signed integer.
    const SIGNED: bool;
}

macro_rules! bits {
    ($($ty:ty: $bits:literal $float:literal $signed:literal)*) => {$(
        impl ScalarWidth for $ty {
            const BITS: u32 = $bits;
            const FLOAT: u32 = $float;
            const SIGNED: bool = $signed;
        }
    )*};
}

bits! {
    bool: 0 0 false u8: 8 0 false i8: 8 0 true u16: 16 0 false i16: 16 0 true u32: 32 0 false i32: 32 0 true
    u64: 64 0 false i64: 64 0 true half::f16: 16 16 false f32: 32 32 false f64: 64 64 false
}

/// Whether no type of these widths has 8 or 16 bits.
#[doc(hidden)]
pub const fn has_no_narrow(bits: &[u32]) -> bool {
    let mut at = 0;
    while at < bits.len() {
        if matches!(bits[at], 8 | 16) {
            return false;
        }
        at += 1;
    }
    true
}

/// Pads a list of one number for each operand.
#[doc(hidden)]
pub const fn operands(words: &[u32]) -> [u32; 3] {
    let mut padded = [0; 3];
    let mut at = 0;
    while at < words.len() {
        padded[at] = words[at];
        at += 1;
    }
    padded
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn run<const W: usize>(cpu_tier: CpuTier, kernel: &LaneKernel, inputs: &[u64]) -> Vec<u64>
    where
        LaneKernel: Width<W>,
    {
        let mut registers = Registers::<W>::new(8).with_cpu_tier(cpu_tier);
        let mut from = [Reg(0); 3];
        let mut next = 2;
        for (at, (&input, &words)) in inputs.iter().zip(&kernel.operands).enumerate() {
            from[at] = Reg(next);
            for word in 0..words {
                registers[Reg(next + word)].0 = [(input >> (32 * word)) as u32; W];
            }
            next += words;
        }
        kernel.run(&mut registers, Reg(0), &from);
        let value = |lane: usize| {
            let high = if kernel.words == 2 { u64::from(registers[Reg(1)].0[lane]) << 32 } else { 0 };
            u64::from(registers[Reg(0)].0[lane]) | high
        };
        (0..W).map(value).collect()
    }

    /// The results of a kernel in every lane of every width of a batch, on every tier of the CPU.
    pub(crate) fn results(kernel: &LaneKernel, inputs: &[u64]) -> Vec<u64> {
        let on = |(_, tier)| {
            [
                run::<1>(tier, kernel, inputs),
                run::<64>(tier, kernel, inputs),
                run::<128>(tier, kernel, inputs),
            ]
            .concat()
        };
        CpuTier::available().into_iter().flat_map(on).collect()
    }

    /// Runs a kernel at every width of a batch and compares every lane.
    pub(crate) fn check_kernel(kernel: &LaneKernel, inputs: &[u64], expected: u64) {
        for value in results(kernel, inputs) {
            assert_eq!(value, expected, "{kernel:?} of {inputs:x?}: {value:#x}, expected {expected:#x}");
        }
    }

    /// Runs a family's kernel of a width on inputs given as bits.
    pub(crate) fn check(family: &'static OpFamily, width: u32, inputs: &[u64], expected: u64) {
        check_kernel(family.kernel(width).expect("a kernel of this width"), inputs, expected);
    }
}
