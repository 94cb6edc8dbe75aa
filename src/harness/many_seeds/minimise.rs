//! Finds a small part of a list that still has a property.

/// Leaves out elements as long as what is left still has a property, which all together have: halves,
/// then smaller and smaller parts (Zeller and Hildebrandt: "Simplifying and Isolating
/// Failure-Inducing Input", 2002). Asks at most so many times.
pub(super) fn minimise<T: Clone>(all: Vec<T>, questions: usize, has_it: impl Fn(&[T]) -> bool) -> Vec<T> {
    let mut left = all;
    let mut parts = 2;
    let mut asked = 0;
    let mut ask = |some: &[T]| {
        asked += 1;
        (asked <= questions).then(|| has_it(some))
    };
    while left.len() > 1 {
        let size = left.len().div_ceil(parts);
        let smaller = left.chunks(size).position(|part| ask(part).unwrap_or(false));
        if let Some(at) = smaller {
            left = left.chunks(size).nth(at).map_or_else(Vec::new, <[T]>::to_vec);
            parts = 2;
            continue;
        }
        let without = |at: usize| {
            let others = left.chunks(size).enumerate().filter(move |(other, _)| *other != at);
            others.flat_map(|(_, part)| part).cloned().collect::<Vec<T>>()
        };
        // Without one of two parts is the other part alone.
        let numbers = if parts > 2 { 0..left.chunks(size).len() } else { 0..0 };
        let rest = numbers.map(without).find(|rest| ask(rest).unwrap_or(false));
        match rest {
            Some(rest) => {
                left = rest;
                parts = (parts - 1).max(2);
            }
            None if size == 1 || ask(&left) != Some(true) => break,
            None => parts *= 2,
        }
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_element_is_found_by_halving() {
        let count = std::cell::Cell::new(0);
        let found = minimise((0..1000).collect(), 100, |some: &[u32]| {
            count.set(count.get() + 1);
            some.contains(&617)
        });
        assert_eq!(found, [617]);
        assert!(count.get() <= 20, "{}", count.get());
    }

    #[test]
    fn two_elements_that_need_each_other_are_found() {
        let both = |some: &[u32]| some.contains(&3) && some.contains(&60);
        assert_eq!(minimise((0..64).collect(), 200, both), [3, 60]);
    }

    #[test]
    fn it_stops_when_it_may_not_ask_any_more() {
        let found = minimise((0..64).collect(), 3, |some: &[u32]| some.contains(&3));
        assert_eq!(found.len(), 8);
        assert!(found.contains(&3));
    }
}
