//! SIMD dispatch: code that is compiled once for each instruction set and chosen at run time.
//!
//! Code on SIMD registers must be inlined into one function that is compiled for their instruction
//! set: a [`LaneTask`]. A closure or a function that is not inlined is compiled for the baseline.

#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};

use crate::math::baseline_simd::BaselineSimd;
use crate::math::f32x4::FmaOps;
use crate::math::f32x8::F32x8Ops;
use crate::math::f64x4::F64x4Ops;

/// A function that is generic over the instruction set, with its arguments.
pub trait LaneTask {
    /// The result.
    type Output;

    /// Runs the function. Implementations must be `#[inline(always)]`.
    fn run<V: LaneOps>(self, simd: V) -> Self::Output;
}

/// The SIMD operations of an instruction set, and the dispatch of further tasks to it.
pub trait LaneOps: F32x8Ops + F64x4Ops + FmaOps {
    /// Runs a task in a function of its own, compiled for this instruction set.
    fn dispatch<T: LaneTask>(self, task: T) -> T::Output;
}

impl LaneOps for BaselineSimd {
    #[inline(never)]
    fn dispatch<T: LaneTask>(self, task: T) -> T::Output {
        task.run(self)
    }
}

#[cfg(target_arch = "x86_64")]
impl LaneOps for V3 {
    #[inline(always)]
    fn dispatch<T: LaneTask>(self, task: T) -> T::Output {
        self.vectorize(InAvx { task, simd: self })
    }
}

/// A task that pulp compiles for AVX2, or for AVX-512, where the compiler vectorizes loops more
/// widely. Operations and results are equal on both.
#[cfg(target_arch = "x86_64")]
struct InAvx<T> {
    task: T,
    simd: V3,
}

#[cfg(target_arch = "x86_64")]
impl<T: LaneTask> pulp::NullaryFnOnce for InAvx<T> {
    type Output = T::Output;

    #[inline(always)]
    fn call(self) -> T::Output {
        self.task.run(self.simd)
    }
}

/// The best instruction set of this CPU: the target's baseline, AVX2 or AVX-512.
#[derive(Clone, Copy, Debug)]
pub struct CpuTier {
    #[cfg(target_arch = "x86_64")]
    avx2: Option<V3>,
    #[cfg(target_arch = "x86_64")]
    avx512: Option<V4>,
}

impl CpuTier {
    /// Detects the instruction set at run time.
    pub fn new() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            avx2: V3::try_new(),
            #[cfg(target_arch = "x86_64")]
            avx512: V4::try_new(),
        }
    }

    /// The token of AVX2; `None` where the CPU does not have it.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    pub fn avx2(self) -> Option<V3> {
        self.avx2
    }

    /// Runs a task on eight lanes: on AVX2 registers if the CPU has them, otherwise on the
    /// baseline's.
    #[inline(always)]
    pub fn run<T: LaneTask>(self, task: T) -> T::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.avx2 {
            return simd.dispatch(task);
        }
        BaselineSimd.dispatch(task)
    }

    /// Whether [`CpuTier::run_wide`] runs tasks on this CPU.
    #[inline]
    pub fn is_wide(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        return self.avx2.is_some();
        #[cfg(not(target_arch = "x86_64"))]
        true
    }

    /// Runs a large task whose loops the compiler vectorizes, on the widest registers of the CPU.
    /// `None` on a CPU of x86-64 without AVX2, for which no such task is compiled.
    #[inline(always)]
    pub fn run_wide<T: LaneTask>(self, task: T) -> Option<T::Output> {
        #[cfg(target_arch = "x86_64")]
        {
            if let Some(simd) = self.avx512 {
                return Some(simd.vectorize(InAvx { task, simd: *simd }));
            }
            self.avx2.map(|simd| simd.dispatch(task))
        }
        #[cfg(not(target_arch = "x86_64"))]
        Some(BaselineSimd.dispatch(task))
    }

    /// Runs a loop that the compiler vectorizes for AVX2; the closure must be inlined.
    #[inline(always)]
    pub fn run_loop<R>(self, function: impl FnOnce() -> R) -> R {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.avx2 {
            return simd.vectorize(function);
        }
        function()
    }
}

impl CpuTier {
    /// The tiers that this CPU has, with their names.
    pub fn available() -> Vec<(&'static str, Self)> {
        let has = Self::new();
        #[cfg(target_arch = "x86_64")]
        let tiers = [
            ("the baseline", Some(Self { avx2: None, avx512: None })),
            ("AVX2", has.avx2.map(|_| Self { avx512: None, ..has })),
            ("AVX-512", has.avx512.map(|_| has)),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let tiers = [("the baseline", Some(has))];
        tiers.into_iter().filter_map(|(name, tier)| tier.map(|tier| (name, tier))).collect()
    }
}

impl Default for CpuTier {
    fn default() -> Self {
        Self::new()
    }
}
