//! How long tests took, and shares of a suite that take equally long.

use std::cmp::Reverse;
use std::path::Path;

use crate::shares::shard::Shard;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::sorted::{SortedMap, sort, sort_by_key};

/// How long tests took, by their names.
///
/// The file is a JSON object with seconds, a line for each test: sorted, and rounded to two digits,
/// so that it changes little when it is written again, and a suite can commit it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    milliseconds: SortedMap<String, u64>,
}

impl Timings {
    /// The timings of tests, given their names and microseconds.
    pub fn of<'a>(tests: impl Iterator<Item = (&'a str, u64)>) -> Self {
        let rounded =
            |(name, micros): (&str, u64)| (name.to_owned(), two_digits(micros.div_ceil(1000).max(1)));
        Self { milliseconds: tests.map(rounded).collect() }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// `InvalidArgument` where it is no object of seconds.
    pub fn read(file: &Path, bytes: &[u8]) -> Result<Self> {
        let refuse = |message: String| {
            Error::new(ErrorKind::InvalidArgument, message).at(Place::File(file.to_path_buf()))
        };
        let seconds: SortedMap<String, f64> = serde_json::from_slice(bytes)
            .map_err(|error| refuse(format!("expected an object of seconds by test names: {error}")))?;
        if let Some((name, wrong)) = seconds.iter().find(|(_, seconds)| !(0.0..=1e9).contains(*seconds)) {
            return Err(refuse(format!("invalid duration of `{name}`: {wrong} seconds")));
        }
        let in_milliseconds = |(name, seconds): (String, f64)| (name, (seconds * 1000.0).round() as u64);
        Ok(Self { milliseconds: seconds.into_iter().map(in_milliseconds).collect() })
    }

    /// The text of a file.
    pub fn to_json(&self) -> String {
        let line = |(name, milliseconds): (&String, &u64)| {
            format!("  {}: {}", serde_json::Value::from(name.as_str()), *milliseconds as f64 / 1000.0)
        };
        let lines: Vec<String> = self.milliseconds.iter().map(line).collect();
        if lines.is_empty() { "{}\n".to_owned() } else { format!("{{\n{}\n}}\n", lines.join(",\n")) }
    }

    /// Whether each of some tests, given their names, belongs to a share, so that shares take about
    /// equally long: the longest test first, each to the share that has least until then. Tests
    /// that are not known count as the median of those that are.
    pub fn share_of(&self, names: &[&str], shard: Shard) -> Vec<bool> {
        let known: Vec<Option<u64>> =
            names.iter().map(|name| self.milliseconds.get(*name).copied()).collect();
        let mut sorted: Vec<u64> = known.iter().copied().flatten().collect();
        sort(&mut sorted);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or(1);
        let weight = |place: usize| known[place].unwrap_or(median);
        let mut places: Vec<usize> = (0..names.len()).collect();
        sort_by_key(&mut places, |&place| (Reverse(weight(place)), place));
        let mut loads = vec![0_u64; shard.of];
        let mut holds = vec![false; names.len()];
        for place in places {
            let least = (0..shard.of).min_by_key(|&share| loads[share]).unwrap_or(0);
            loads[least] += weight(place);
            holds[place] = least == shard.number - 1;
        }
        holds
    }
}

/// A number rounded to two digits.
fn two_digits(number: u64) -> u64 {
    let unit = 10_u64.pow(number.max(1).ilog10().saturating_sub(1));
    (number + unit / 2) / unit * unit
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn files_are_sorted_rounded_and_read_again() {
        let timings = Timings::of([("b", 1_234_567), ("a \"x\"", 20), ("c", 94_600)].into_iter());
        let text = "{\n  \"a \\\"x\\\"\": 0.001,\n  \"b\": 1.2,\n  \"c\": 0.095\n}\n";
        assert_eq!(timings.to_json(), text);
        assert_eq!(Timings::read(Path::new("t"), text.as_bytes()).unwrap(), timings);
        assert_eq!(Timings::default().to_json(), "{}\n");
        for (wrong, words) in
            [("[]", "expected an object"), ("{\"a\": -1}", "-1 seconds"), ("", "expected an object")]
        {
            let told = Timings::read(Path::new("t.json"), wrong.as_bytes()).unwrap_err().render();
            assert!(told.contains(words) && told.contains("in t.json"), "{told}");
        }
    }

    /// 9 and 5 + 4: the longest first, and then each to the share that has least. The unknown test
    /// takes the median of 4, 5 and 9.
    #[test]
    fn shares_take_equally_long() {
        let timings = Timings::of([("a", 4_000), ("b", 9_000), ("c", 5_000)].into_iter());
        let share = |number| timings.share_of(&["a", "b", "c"], Shard { number, of: 2 });
        assert_eq!(share(1), [false, true, false]);
        assert_eq!(share(2), [true, false, true]);
        // 9 | 5 + 5 | then a goes to the first.
        let share = |number| timings.share_of(&["a", "b", "c", "new"], Shard { number, of: 2 });
        assert_eq!(share(1), [true, true, false, false]);
        assert_eq!(share(2), [false, false, true, true]);
    }

    proptest! {
        #[test]
        fn shares_are_disjoint_and_complete_whatever_the_file_says(
            seconds in prop::collection::vec(prop::option::of(0..1_000_000_000u64), 0..20),
            of in 1..7usize,
        ) {
            let names: Vec<String> = (0..seconds.len()).map(|at| format!("t{at}")).collect();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let known = names.iter().zip(&seconds).filter_map(|(name, micros)| Some((*name, (*micros)?)));
            let timings = Timings::of(known);
            let shares: Vec<Vec<bool>> =
                (1..=of).map(|number| timings.share_of(&names, Shard { number, of })).collect();
            for place in 0..names.len() {
                prop_assert_eq!(shares.iter().filter(|share| share[place]).count(), 1);
            }
        }
    }
}
