//! Code that operates on vectors, compiled for what the processor has.
//!
//! What operates on vectors must be inlined into one function that is compiled for them: a [`Task`]. Closures
//! are functions of their own, and so is what is not inlined.

#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};

use crate::math::doubles::Doubles;
use crate::math::eight::{Eights, TwoFours};
use crate::math::four::Fused;

/// What operates on vectors.
pub trait Task {
    /// What comes of it.
    type Output;

    /// To be inlined.
    fn run<V: Vectors>(self, vectors: V) -> Self::Output;
}

/// A way to operate on vectors, and to have more of that compiled alike.
pub trait Vectors: Eights + Doubles + Fused {
    /// Runs a task in a function of its own.
    fn apart<T: Task>(self, task: T) -> T::Output;
}

impl Vectors for TwoFours {
    #[inline(never)]
    fn apart<T: Task>(self, task: T) -> T::Output {
        task.run(self)
    }
}

#[cfg(target_arch = "x86_64")]
impl Vectors for V3 {
    #[inline(always)]
    fn apart<T: Task>(self, task: T) -> T::Output {
        self.vectorize(InAvx { task, simd: self })
    }
}

/// To be compiled for AVX2, or for AVX-512, where the compiler makes wider vectors of loops: the same operations, and
/// the same results.
#[cfg(target_arch = "x86_64")]
struct InAvx<T> {
    task: T,
    simd: V3,
}

#[cfg(target_arch = "x86_64")]
impl<T: Task> pulp::NullaryFnOnce for InAvx<T> {
    type Output = T::Output;

    #[inline(always)]
    fn call(self) -> T::Output {
        self.task.run(self.simd)
    }
}

/// What the processor has beyond the target's baseline.
#[derive(Clone, Copy, Debug)]
pub struct Processor {
    #[cfg(target_arch = "x86_64")]
    simd: Option<V3>,
    #[cfg(target_arch = "x86_64")]
    widest: Option<V4>,
}

impl Processor {
    /// Asks it.
    pub fn new() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            simd: V3::try_new(),
            #[cfg(target_arch = "x86_64")]
            widest: V4::try_new(),
        }
    }

    /// What says that it has AVX2, where it has.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    pub fn avx2(self) -> Option<V3> {
        self.simd
    }

    /// Runs a task on vectors of eight: those of AVX2 where it has them.
    #[inline(always)]
    pub fn run<T: Task>(self, task: T) -> T::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.simd {
            return simd.apart(task);
        }
        TwoFours.apart(task)
    }

    /// Runs a task whose loops the compiler makes vectors of, on the widest that it has.
    #[inline(always)]
    pub fn run_widest<T: Task>(self, task: T) -> T::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.widest {
            return simd.vectorize(InAvx { task, simd: *simd });
        }
        self.run(task)
    }

    /// Runs a loop that the compiler makes vectors of; a closure that is to be inlined.
    #[inline(always)]
    pub fn run_loop<R>(self, function: impl FnOnce() -> R) -> R {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.simd {
            return simd.vectorize(function);
        }
        function()
    }
}

#[cfg(any(test, feature = "stress"))]
impl Processor {
    /// Each level up to what it has, and its name.
    pub fn levels() -> Vec<(&'static str, Self)> {
        let has = Self::new();
        #[cfg(target_arch = "x86_64")]
        let levels = [
            ("the baseline", Some(Self { simd: None, widest: None })),
            ("AVX2", has.simd.map(|_| Self { widest: None, ..has })),
            ("AVX-512", has.widest.map(|_| has)),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let levels = [("the baseline", Some(has))];
        levels.into_iter().filter_map(|(name, level)| level.map(|level| (name, level))).collect()
    }
}

impl Default for Processor {
    fn default() -> Self {
        Self::new()
    }
}
