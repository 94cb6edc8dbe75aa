//! Finds a small part of a list that still has a property.

/// Leaves out elements as long as what is left still has a property, which all together have:
/// halves, then smaller and smaller parts (Zeller and Hildebrandt: "Simplifying and Isolating
/// Failure-Inducing Input", 2002). Asks at most so many times.
pub(super) fn minimise<T: Clone>(
    mut left: Vec<T>,
    mut questions: usize,
    has_it: impl Fn(&[T]) -> bool,
) -> Vec<T> {
    let mut parts = 2;
    while left.len() > 1 && questions > 0 {
        let size = left.len().div_ceil(parts);
        let chunks: Vec<&[T]> = left.chunks(size).collect();
        let mut ask = |some: &[T]| {
            let may_ask = questions > 0;
            questions -= usize::from(may_ask);
            may_ask && has_it(some)
        };
        let part = chunks.iter().find(|part| ask(part)).map(|part| (part.to_vec(), 2));
        let smaller = part.or_else(|| {
            // Without one of two parts is the other part alone.
            let numbers = if parts > 2 { 0..chunks.len() } else { 0..0 };
            let rest = numbers.map(|at| without(&chunks, at)).find(|rest| ask(rest))?;
            Some((rest, parts - 1))
        });
        match smaller {
            Some(found) => (left, parts) = found,
            None if size == 1 => break,
            None => parts *= 2,
        }
    }
    left
}

/// The elements of all parts but one.
fn without<T: Clone>(parts: &[&[T]], at: usize) -> Vec<T> {
    let others = parts.iter().enumerate().filter(|(other, _)| *other != at);
    others.flat_map(|(_, part)| part.iter().cloned()).collect()
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
