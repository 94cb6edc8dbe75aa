//! Which part of some work is meant.

use std::str::FromStr;

use anyhit_base::error::{Error, ErrorKind, Result};

/// A share of some work: which of how many. Together the shares hold each piece once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1.
    pub number: usize,
    /// How many there are.
    pub of: usize,
}

impl Shard {
    /// The most shares that some work has.
    pub const MOST: usize = 1 << 16;

    /// All of the work.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Whether the share holds the piece at a place, counted from 0: every so manieth.
    pub fn holds(self, place: usize) -> bool {
        place % self.of == self.number - 1
    }
}

/// `K/N`
impl FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts = text.split_once('/').map(|(number, of)| (number.trim().parse(), of.trim().parse()));
        match parts {
            Some((Ok(number), Ok(of))) if (1..=of).contains(&number) && of <= Self::MOST => {
                Ok(Self { number, of })
            }
            _ => {
                let message = format!("`{text}` is not K/N with 1 <= K <= N <= {}, such as 2/5", Self::MOST);
                Err(Error::new(ErrorKind::InvalidArgument, message))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read_or_refused() {
        assert_eq!("2/5".parse::<Shard>().unwrap(), Shard { number: 2, of: 5 });
        for wrong in ["", "2", "0/5", "6/5", "1/0", "a/b", "-1/3", "1/65537"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn shards_are_disjoint_and_complete() {
        for place in 0..11 {
            let holders: Vec<usize> =
                (1..=3).filter(|&number| Shard { number, of: 3 }.holds(place)).collect();
            assert_eq!(holders.len(), 1, "{place}");
        }
    }
}
