//! Sorting of few items: the order is found by one function for all types.

use std::cmp::Ordering;

/// Sorts items. Those that are equal keep their order.
pub fn sort<T: Ord>(items: &mut [T]) {
    sort_by(items, T::cmp);
}

/// Sorts items by a key. Items with equal keys keep their order.
pub fn sort_by_key<T, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K) {
    sort_by(items, |one, other| key(one).cmp(&key(other)));
}

/// Sorts items by a comparison. Items that it calls equal keep their order.
pub fn sort_by<T>(items: &mut [T], compare: impl Fn(&T, &T) -> Ordering) {
    if items.len() < 2 {
        return;
    }
    let mut order = order(items.len(), &|one, other| compare(&items[one], &items[other]));
    for first in 0..items.len() {
        // Along each cycle an item comes to its place, and what was there goes on to the next.
        let mut place = first;
        while order[place] != first {
            let from = std::mem::replace(&mut order[place], place);
            items.swap(place, from);
            place = from;
        }
        order[place] = place;
    }
}

/// The numbers of the items in ascending order.
fn order(count: usize, compare: &dyn Fn(usize, usize) -> Ordering) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&one, &other| compare(one, other));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_items_in_one_cycle_take_no_longer_than_others() {
        // The last comes first and each of the others moves by one: steps of all would be 2^34.
        let count = 1 << 17;
        let mut items: Vec<u32> = (1..count).chain([0]).collect();
        sort_by_key(&mut items, |&item| item);
        assert!(items.iter().copied().eq(0..count));
        items.reverse();
        sort_by_key(&mut items, |&item| item);
        assert!(items.iter().copied().eq(0..count));
    }

    #[test]
    fn items_are_sorted_as_the_standard_library_does() {
        // Some hundred lists of numbers, with their places to tell equal ones apart.
        let mut state = 1_u32;
        for count in 0..200 {
            let mut items: Vec<(u32, usize)> = (0..count)
                .map(|place| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (state >> 26, place)
                })
                .collect();
            let mut expected = items.clone();
            expected.sort_by_key(|(number, _)| *number);
            sort_by_key(&mut items, |(number, _)| *number);
            assert_eq!(items, expected);
        }
    }
}
