//! Affine expressions in launch indices, for the indices of memory accesses.

use smallvec::SmallVec;

use crate::machine::Binding;

/// Consecutive numbers, the first of which is an affine expression, as long as its bounds hold.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AffineRange {
    pub from: AffineExpr,
    pub count: u64,
    /// What must hold for the numbers to be these, which a launch's size decides.
    pub bounds: Bounds,
}

/// Expressions, each with the number that its value must lie below. None may be negative.
pub(super) type Bounds = SmallVec<[(AffineExpr, u32); 1]>;

/// The most bounds that a range may have.
const MAX_BOUNDS: usize = 8;

/// The bounds of two ranges together; `None` for too many.
pub(super) fn both(mut bounds: Bounds, others: &Bounds) -> Option<Bounds> {
    for other in others {
        if !bounds.contains(other) {
            bounds.push(other.clone());
        }
    }
    (bounds.len() <= MAX_BOUNDS).then_some(bounds)
}

/// A factor of a term of an [`AffineExpr`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Symbol {
    /// A component of `LaunchIdKHR`, or of `WorkgroupId`.
    Index(u8),
    /// A component of `LocalInvocationId`.
    Local(u8),
    /// A component of `LaunchSizeKHR`, or of `NumWorkgroups`.
    Size(u8),
    /// The word at a byte offset of the push constants, or of an element of a binding: uniform over
    /// all invocations, and known once the resources are.
    Word(Option<(Binding, u32)>, u32),
}

/// A sum of products of symbols, each with its factor; sorted. It is affine in the indices once the
/// launch fixes its sizes and words (MLIR calls that semi-affine).
#[derive(Clone, Debug, PartialEq, Default)]
pub(super) struct AffineExpr(pub SmallVec<[(SmallVec<[Symbol; 2]>, i64); 4]>);

/// The most terms, and factors of one term, that an expression may have.
const MAX_TERMS: usize = 12;

impl AffineExpr {
    pub(super) fn constant(value: i64) -> Self {
        Self::of(SmallVec::new(), value)
    }

    pub(super) fn symbol(symbol: Symbol) -> Self {
        Self::of(SmallVec::from_slice(&[symbol]), 1)
    }

    pub(super) fn of(symbols: SmallVec<[Symbol; 2]>, factor: i64) -> Self {
        Self(if factor == 0 { SmallVec::new() } else { SmallVec::from_iter([(symbols, factor)]) })
    }

    pub(super) fn plus(mut self, other: &Self) -> Option<Self> {
        for (symbols, factor) in &other.0 {
            match self.0.iter_mut().find(|(known, _)| known == symbols) {
                Some((_, known)) => *known = known.checked_add(*factor)?,
                None => self.0.push((symbols.clone(), *factor)),
            }
        }
        self.0.sort_unstable();
        (self.0.len() <= MAX_TERMS).then_some(self)
    }

    pub(super) fn times(&self, other: &Self) -> Option<Self> {
        let mut product = Self::default();
        for (a, left) in &self.0 {
            for (b, right) in &other.0 {
                let mut symbols = a.clone();
                symbols.extend(b.iter().copied());
                symbols.sort_unstable();
                if symbols.len() > MAX_TERMS {
                    return None;
                }
                product = product.plus(&Self::of(symbols, left.checked_mul(*right)?))?;
            }
        }
        Some(product)
    }

    /// Splits it into its constant term and the rest.
    pub(super) fn split(&self) -> (i64, Self) {
        let constant = self.0.iter().find(|(symbols, _)| symbols.is_empty()).map_or(0, |term| term.1);
        (constant, Self(self.0.iter().filter(|(symbols, _)| !symbols.is_empty()).cloned().collect()))
    }
}

impl AffineRange {
    /// One number, without bounds.
    pub(super) fn exactly(from: AffineExpr) -> Self {
        Self { from, count: 1, bounds: Bounds::new() }
    }

    /// Whether no value of one range is a value of the other. This compares the constant terms
    /// modulo the greatest power of two that divides all other factors, at most 2^32, so it also
    /// holds if 32-bit arithmetic wraps around. Of ranges with bounds it is not known.
    pub(super) fn is_disjoint_from(&self, other: &Self) -> bool {
        if !(self.bounds.is_empty() && other.bounds.is_empty()) {
            return false;
        }
        let ((own, rest), (others, other_rest)) = (self.from.split(), other.from.split());
        let terms = rest.0.iter().chain(&other_rest.0);
        let zeros = terms.map(|(_, factor)| factor.trailing_zeros()).min().unwrap_or(32).min(32);
        let step = 1u64 << zeros;
        let distance = others.wrapping_sub(own).rem_euclid(step as i64) as u64;
        let fits = |distance: u64, count: u64| distance > 0 && count <= distance;
        fits(distance, self.count) && fits(step - distance, other.count)
    }
}

pub(super) fn scaled(range: AffineRange, by: u64) -> Option<AffineRange> {
    let count = (range.count - 1).checked_mul(by)?.checked_add(1)?;
    Some(AffineRange { from: range.from.times(&AffineExpr::constant(by.try_into().ok()?))?, count, ..range })
}
