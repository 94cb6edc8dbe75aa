//! Independent work on all threads.

use std::sync::Mutex;

use rayon::prelude::*;

/// Applies a function to the numbers below `count` on all threads. Returns the results in the order
/// of the numbers.
///
/// The function is called through a pointer, and what it returns is not passed through rayon, which
/// would be instantiated for each type of either.
pub fn map_on_threads<T: Send>(count: usize, function: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let results: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    call_on_threads(count, &|at| {
        let result = function(at);
        *results[at].lock().expect("bug in anyhit: a result is written once") = Some(result);
    });
    let result = |one: Mutex<Option<T>>| one.into_inner().ok().flatten();
    results.into_iter().map(|one| result(one).expect("bug in anyhit: every number has a result")).collect()
}

/// Calls a function with each number below `count`, on all threads.
fn call_on_threads(count: usize, function: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(function);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_numbers() {
        assert_eq!(map_on_threads(5, |at| at * at), [0, 1, 4, 9, 16]);
        assert!(map_on_threads(0, |at| at).is_empty());
    }

    #[test]
    fn a_panic_reaches_the_caller() {
        let run = || map_on_threads(3, |at| assert!(at < 2, "number {at}"));
        let payload = std::panic::catch_unwind(run).expect_err("the last one panics");
        assert_eq!(payload.downcast_ref::<String>().map(String::as_str), Some("number 2"));
    }
}
