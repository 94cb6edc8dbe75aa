//! Compositions of two functions, where the result of the first goes into the second alone. Each
//! function rounds as it does by itself.

use std::marker::PhantomData;

use crate::ops::lane_kernel::{Binary, Ternary, Unary};

/// How the functions of a pair are composed: see the types of these names here and in
/// [`words`](super::words).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairShape {
    Then,
    After,
    ThenWith,
    WithItself,
    Chain,
    Last,
}

/// `F(a, b)`, then `G(that, c)`.
pub struct Then<F, G>(PhantomData<(F, G)>);

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

/// `F(a, b)`, then `G(c, that)`.
pub struct After<F, G>(PhantomData<(F, G)>);

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

/// `F(a)`, then `G(that, b)`.
pub struct ThenWith<F, G>(PhantomData<(F, G)>);

impl<F: Unary, G: Binary<A = F::R>> Binary for ThenWith<F, G> {
    type A = F::A;
    type B = G::B;
    type R = G::R;
    #[inline(always)]
    fn apply(a: F::A, b: G::B) -> G::R {
        G::apply(F::apply(a), b)
    }
}

/// `F(a, b)`, then `G(a, that)`.
pub struct WithItself<F, G>(PhantomData<(F, G)>);

impl<F: Binary, G: Binary<A = F::A, B = F::R>> Binary for WithItself<F, G> {
    type A = F::A;
    type B = F::B;
    type R = G::R;
    #[inline(always)]
    fn apply(a: F::A, b: F::B) -> G::R {
        G::apply(a, F::apply(a, b))
    }
}
