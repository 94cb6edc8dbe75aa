//! Compositions of two functions, where the result of the first is an operand of the second and has
//! no other use. Each function is rounded separately.

use std::marker::PhantomData;

use crate::ops::lane_kernel::{Binary, Ternary, Unary};

/// How the functions of a pair are composed: each variant stands for the type with its name, here
/// or in [`words`](super::words).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PairShape {
    Then,
    After,
    ThenWith,
    WithItself,
    Chain,
    Last,
}

/// `f = F(a, b)`, then `G(f, c)`.
pub(super) struct Then<F, G>(PhantomData<(F, G)>);

impl<F: Binary, G: Binary<A = F::R>> Ternary for Then<F, G> {
    type A = F::A;
    type B = F::B;
    type C = G::B;
    type R = G::R;
    #[inline(always)]
    fn apply(a: F::A, b: F::B, c: G::B) -> G::R {
        G::apply(F::apply(a, b), c)
    }
}

/// `f = F(a, b)`, then `G(c, f)`.
pub(super) struct After<F, G>(PhantomData<(F, G)>);

impl<F: Binary, G: Binary<B = F::R>> Ternary for After<F, G> {
    type A = F::A;
    type B = F::B;
    type C = G::A;
    type R = G::R;
    #[inline(always)]
    fn apply(a: F::A, b: F::B, c: G::A) -> G::R {
        G::apply(c, F::apply(a, b))
    }
}

/// `f = F(a)`, then `G(f, b)`.
pub(super) struct ThenWith<F, G>(PhantomData<(F, G)>);

impl<F: Unary, G: Binary<A = F::R>> Binary for ThenWith<F, G> {
    type A = F::A;
    type B = G::B;
    type R = G::R;
    #[inline(always)]
    fn apply(a: F::A, b: G::B) -> G::R {
        G::apply(F::apply(a), b)
    }
}

/// `f = F(a, b)`, then `G(a, f)`.
pub(super) struct WithItself<F, G>(PhantomData<(F, G)>);

impl<F: Binary, G: Binary<A = F::A, B = F::R>> Binary for WithItself<F, G> {
    type A = F::A;
    type B = F::B;
    type R = G::R;
    #[inline(always)]
    fn apply(a: F::A, b: F::B) -> G::R {
        G::apply(a, F::apply(a, b))
    }
}
