//! Sets of results of shares, as files hold them.

use std::fmt::Debug;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::shares::shard::Shard;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::sorted::SortedMap;
use anyhit_compile::bytes_hash;

/// The version of the files.
const VERSION: u32 = 1;

/// The version of this crate: results of another one may be of other tests.
const ANYHIT: &str = env!("CARGO_PKG_VERSION");

/// What a command found in one share.
pub trait ShareResult: Clone + Debug + PartialEq + Serialize + DeserializeOwned {
    /// The command's name.
    const COMMAND: &'static str;

    /// What all shares of a run have in common: what is run and how, as an object.
    type Whole: Clone + Debug + PartialEq + Serialize + DeserializeOwned;

    /// The result without how long anything took: that of a second run of the share.
    #[must_use]
    fn without_times(&self) -> Self;
}

/// The results of some shares of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "", deny_unknown_fields)]
pub struct ShareResults<R: ShareResult> {
    anyhit_result: u32,
    anyhit: String,
    command: String,
    of: usize,
    whole: R::Whole,
    shares: SortedMap<usize, R>,
    /// The file that each share was read from.
    #[serde(skip)]
    files: SortedMap<usize, String>,
}

/// A hash of texts, by which two runs are told apart.
pub fn fingerprint<'a>(texts: impl Iterator<Item = &'a str>) -> String {
    // A byte that no text has ends each.
    let bytes: Vec<u8> = texts.flat_map(|text| text.bytes().chain([0xFF])).collect();
    bytes_hash(&bytes)
}

/// What every file begins with, whatever the command and the version.
#[derive(Deserialize)]
struct Header {
    anyhit_result: u32,
    anyhit: String,
    command: String,
}

/// The command whose result a file holds.
///
/// # Errors
/// `InvalidArgument` where it holds none, or one of another version.
pub fn command_of(file: &Path, bytes: &[u8]) -> Result<String> {
    let header: Header = serde_json::from_slice(bytes).map_err(|error| no_result(file, &error))?;
    let refuse = |message: String| {
        Err(Error::new(ErrorKind::InvalidArgument, message).at(Place::File(file.to_path_buf())))
    };
    if header.anyhit != ANYHIT {
        return refuse(format!(
            "the file was written by anyhit {}, but this is {ANYHIT}: all shares must have the same \
             version",
            header.anyhit
        ));
    }
    if header.anyhit_result != VERSION {
        return refuse(format!(
            "the result has version {} of the format, but this anyhit reads version {VERSION}",
            header.anyhit_result
        ));
    }
    Ok(header.command)
}

fn no_result(file: &Path, error: &serde_json::Error) -> Error {
    let message = format!("not a result that `--result` wrote: {error}");
    Error::new(ErrorKind::InvalidArgument, message).at(Place::File(file.to_path_buf()))
}

impl<R: ShareResult> ShareResults<R> {
    /// The result of one share.
    pub fn new(whole: R::Whole, shard: Shard, result: R) -> Self {
        Self {
            anyhit_result: VERSION,
            anyhit: ANYHIT.to_owned(),
            command: R::COMMAND.to_owned(),
            of: shard.of,
            whole,
            shares: [(shard.number, result)].into(),
            files: SortedMap::new(),
        }
    }

    /// The results that a file holds, of this version and of the command's.
    ///
    /// # Errors
    /// As [`command_of`]; `InvalidArgument` for another command, and where shares are missing that
    /// cannot be, or numbers make no sense.
    pub fn read(file: &Path, bytes: &[u8]) -> Result<Self> {
        let refuse = |message: String| {
            Err(Error::new(ErrorKind::InvalidArgument, message).at(Place::File(file.to_path_buf())))
        };
        let command = command_of(file, bytes)?;
        if command != R::COMMAND {
            return refuse(format!("this is a result of `anyhit {command}`, not of `anyhit {}`", R::COMMAND));
        }
        let mut read: Self = serde_json::from_slice(bytes).map_err(|error| no_result(file, &error))?;
        if read.shares.is_empty() {
            return refuse("the file contains no results".to_owned());
        }
        if read.of > Shard::MOST {
            return refuse(format!("the run has {} shards, more than the limit of {}", read.of, Shard::MOST));
        }
        if let Some(wrong) = read.shares.keys().find(|number| !(1..=read.of).contains(number)) {
            return refuse(format!("the file contains shard {wrong} of {}", read.of));
        }
        read.files = read.shares.keys().map(|&number| (number, escape::path(&file).to_string())).collect();
        Ok(read)
    }

    /// The results of both. A share that both hold is kept once.
    ///
    /// # Errors
    /// `InvalidArgument` where they are of different runs, or hold different results of one share.
    pub fn merge(mut self, other: Self) -> Result<Self> {
        let names = [self.name(), other.name()];
        if let Some(difference) = difference(&self, &other) {
            let message = format!("{} is of a different run than {}: {difference}", names[1], names[0]);
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        let mut files = other.files;
        for (number, result) in other.shares {
            let file = files.remove(&number);
            let kept = match self.shares.remove(&number) {
                None => result,
                Some(known) if known.without_times() == result.without_times() => earlier(known, result),
                Some(_) => {
                    let shown = |file: Option<&String>| file.cloned().unwrap_or_default();
                    let message = format!(
                        "shard {number} of {} is in {} and in {}, with different results",
                        self.of,
                        shown(self.files.get(&number)),
                        shown(file.as_ref())
                    );
                    return Err(Error::new(ErrorKind::InvalidArgument, message).note(
                        "repeated runs of a shard differ only in times: one of the runs read other files",
                    ));
                }
            };
            self.shares.insert(number, kept);
            if let Some(file) = file {
                self.files.entry(number).or_insert(file);
            }
        }
        Ok(self)
    }

    /// What the first share was read from.
    fn name(&self) -> String {
        self.files.values().next().cloned().unwrap_or_default()
    }

    /// The numbers of the shares that are not here.
    pub fn missing(&self) -> Vec<usize> {
        (1..=self.of).filter(|number| !self.shares.contains_key(number)).collect()
    }

    /// How many shares the run has.
    pub fn of(&self) -> usize {
        self.of
    }

    /// What all shares have in common.
    pub fn whole(&self) -> &R::Whole {
        &self.whole
    }

    /// The results, in the order of the shares' numbers.
    pub fn shares(&self) -> impl Iterator<Item = &R> {
        self.shares.values()
    }

    /// The text of a file.
    ///
    /// # Errors
    /// `Io` where the writer of JSON fails.
    pub fn to_json(&self) -> Result<String> {
        let text = serde_json::to_string(self);
        text.map(|text| text + "\n")
            .map_err(|error| Error::new(ErrorKind::Io, format!("the result as JSON: {error}")))
    }
}

/// Of two results of one share that differ in times alone, the one whose text comes first: which of
/// them is kept does not depend on the order of files.
fn earlier<R: ShareResult>(one: R, other: R) -> R {
    let text = |result: &R| serde_json::to_string(result).unwrap_or_default();
    if text(&other) < text(&one) { other } else { one }
}

/// In what two results are of different runs.
fn difference<R: ShareResult>(one: &ShareResults<R>, other: &ShareResults<R>) -> Option<String> {
    if one.of != other.of {
        return Some(format!("it has {} shards, not {}", other.of, one.of));
    }
    if one.whole == other.whole {
        return None;
    }
    let fields = |results: &ShareResults<R>| match serde_json::to_value(&results.whole) {
        Ok(Value::Object(fields)) => fields,
        _ => serde_json::Map::new(),
    };
    let (one, other) = (fields(one), fields(other));
    let differs = one.iter().find(|(key, value)| other.get(*key) != Some(value));
    Some(match differs {
        Some((key, value)) => {
            let other = other.get(key).unwrap_or(&Value::Null);
            format!("its `{key}` is {other}, not {value}")
        }
        None => "their settings differ".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A number that was found, and a time.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Found {
        number: u32,
        seconds: u32,
    }

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct FoundWhole {
        seed: u32,
    }

    impl ShareResult for Found {
        const COMMAND: &'static str = "find";
        type Whole = FoundWhole;

        fn without_times(&self) -> Self {
            Self { seconds: 0, ..self.clone() }
        }
    }

    fn share(number: usize, seconds: u32) -> ShareResults<Found> {
        let found = Found { number: number as u32 * 10, seconds };
        ShareResults::new(FoundWhole { seed: 1 }, Shard { number, of: 4 }, found)
    }

    proptest! {
        #[test]
        fn neither_order_nor_grouping_matters(
            shares in prop::collection::vec((1..5usize, 0..3u32), 3..6),
            cut in 1..3usize,
        ) {
            let results: Vec<_> = shares.iter().map(|&(number, seconds)| share(number, seconds)).collect();
            let all = |list: Vec<ShareResults<Found>>| {
                list.into_iter().reduce(|one, other| one.merge(other).unwrap()).unwrap()
            };
            let forwards = all(results.clone());
            let backwards = all(results.iter().rev().cloned().collect());
            let (first, second) = results.split_at(cut);
            let grouped = all(first.to_vec()).merge(all(second.to_vec())).unwrap();
            prop_assert_eq!(&forwards, &backwards);
            prop_assert_eq!(&forwards, &grouped);
            let again = ShareResults::<Found>::read(Path::new("a"), forwards.to_json().unwrap().as_bytes());
            prop_assert_eq!(again.unwrap().shares, forwards.shares);
        }
    }

    fn refusal(text: &str) -> String {
        ShareResults::<Found>::read(Path::new("a.json"), text.as_bytes()).unwrap_err().render()
    }

    #[test]
    fn files_of_others_are_refused_with_the_cause() {
        let good = share(2, 0).to_json().unwrap();
        for (from, to, words) in [
            ("\"find\"", "\"seek\"", "a result of `anyhit seek`, not of `anyhit find`"),
            ("\"anyhit_result\":1", "\"anyhit_result\":2", "version 2 of the format"),
            (ANYHIT, "0.0.1", "written by anyhit 0.0.1"),
            ("\"of\":4", "\"of\":99999999999", "the run has 99999999999 shards"),
            ("\"2\":", "\"5\":", "the file contains shard 5 of 4"),
            ("\"2\":", "\"x\":", "not a result that `--result` wrote"),
            ("{", "", "not a result that `--result` wrote"),
            ("\"seed\"", "\"seeds\"", "missing field `seed`"),
        ] {
            assert!(good.contains(from), "{from}");
            let told = refusal(&good.replacen(from, to, 1));
            assert!(told.contains(words) && told.contains("in a.json"), "{words}: {told}");
        }
    }

    #[test]
    fn what_does_not_belong_together_is_told() {
        let (one, mut other) = (share(1, 0), share(1, 5));
        let read = |name: &str, share: &ShareResults<Found>| {
            ShareResults::<Found>::read(Path::new(name), share.to_json().unwrap().as_bytes()).unwrap()
        };
        let merged = read("a", &one).merge(read("b", &other)).unwrap();
        assert_eq!((merged.shares[&1].seconds, merged.missing()), (0, vec![2, 3, 4]));
        other.shares.get_mut(&1).unwrap().number = 11;
        let told = read("a", &one).merge(read("b", &other)).unwrap_err().render();
        assert!(told.contains("shard 1 of 4 is in a and in b, with different results"), "{told}");
        let mut other = share(2, 0);
        other.whole.seed = 7;
        let told = read("a", &one).merge(read("b", &other)).unwrap_err().render();
        assert!(told.contains("b is of a different run than a: its `seed` is 7, not 1"), "{told}");
        let mut other = share(2, 0);
        other.of = 3;
        let told = read("a", &one).merge(read("b", &other)).unwrap_err().render();
        assert!(told.contains("it has 3 shards, not 4"), "{told}");
    }
}
