//! Which two invocations, subgroups or workgroups it is whose order makes a difference.
//!
//! The orders between this crate's and the drawn one form a row, in which neighbours differ in one
//! exchange of two units that run one after the other. At one end outputs are as they are by
//! themselves, at the other they differ: bisection finds two neighbours of which one differs.

use crate::many_seeds::runs::{Drawing, Runs};
use anyhit_engine::machine::{OrderLimits, OrderPart};
use anyhit_engine::math::permutation::OrderLimit;

/// What of the drawn orders suffices for a difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SmallestOrder {
    /// One exchange, at the end of these.
    Exchange(OrderLimits),
    /// Without any exchange: invocations that run one after the other, in place of side by side.
    OneByOne(OrderLimits),
}

/// All of both orders is in this crate's order.
const OWN: OrderLimits = OrderLimits { grid: OrderLimit::NONE, workgroup: OrderLimit::NONE };

/// What of the orders of a pass suffices for the difference that a drawing makes; `None` where no
/// order does alone.
pub(super) fn smallest(runs: &Runs<'_>, drawing: &Drawing, pass: u32) -> Option<SmallestOrder> {
    let differs = |limits: OrderLimits| {
        let orders = Some(limits);
        runs.difference(&Drawing { orders, ..drawing.clone() }).is_some()
    };
    if differs(OWN) {
        return Some(SmallestOrder::OneByOne(OWN));
    }
    [OrderPart::Grid, OrderPart::Workgroup].into_iter().find_map(|part| {
        let limits = |limit| match part {
            OrderPart::Grid => OrderLimits { grid: limit, ..OWN },
            OrderPart::Workgroup => OrderLimits { workgroup: limit, ..OWN },
        };
        let count = runs.ordered_count(pass, part);
        let prefix = |prefix| limits(OrderLimit { prefix, jump: 0 });
        if count < 2 || !differs(prefix(count)) {
            return None;
        }
        let prefix = last_without(count, |number| differs(prefix(number)));
        let jump = |jump| limits(OrderLimit { prefix, jump });
        let before = last_without(count, |number| differs(jump(number)));
        Some(SmallestOrder::Exchange(jump(before + 1)))
    })
}

/// A number below `end` without a property, whose successor has it: 0 does not have it, and `end`
/// does.
fn last_without(end: u64, mut has_it: impl FnMut(u64) -> bool) -> u64 {
    let (mut low, mut high) = (0, end);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        match has_it(middle) {
            true => high = middle,
            false => low = middle,
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bisection_finds_where_a_property_begins() {
        for begin in 1..=20 {
            assert_eq!(last_without(20, |number| number >= begin), begin - 1);
        }
    }

    #[test]
    fn of_a_property_that_comes_and_goes_one_beginning_is_found() {
        let has_it = |number: u64| number == 3 || number > 9;
        let last = last_without(20, has_it);
        assert!(!has_it(last) && has_it(last + 1));
    }
}
