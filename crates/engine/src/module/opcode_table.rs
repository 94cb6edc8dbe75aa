//! Tables by the number of an instruction.

/// A table by the number of an instruction. Few of the numbers are taken and the greatest are in
/// the thousands, so that entries lie side by side and are found by their positions.
#[derive(Debug)]
pub(crate) struct OpcodeTable<T> {
    /// By number: 1 and the index of the entry; 0 where there is none.
    positions: Vec<u16>,
    entries: Vec<T>,
}

impl<T> OpcodeTable<T> {
    /// The entry of a number.
    #[inline]
    pub(crate) fn get(&self, number: usize) -> Option<&T> {
        let position = usize::from(*self.positions.get(number)?);
        self.entries.get(position.checked_sub(1)?)
    }
}

/// Makes a table of numbers below 2^16; of several entries of one number the last counts.
impl<T> FromIterator<(u16, T)> for OpcodeTable<T> {
    fn from_iter<I: IntoIterator<Item = (u16, T)>>(all: I) -> Self {
        let (numbers, entries): (Vec<u16>, Vec<T>) = all.into_iter().unzip();
        let count = numbers.iter().max().map_or(0, |&last| usize::from(last) + 1);
        let mut positions = vec![0; count];
        for (&number, position) in numbers.iter().zip(1..) {
            positions[usize::from(number)] = position;
        }
        Self { positions, entries }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_is_found_by_its_number() {
        let table: OpcodeTable<&str> = [(7, "a"), (65_535, "b"), (0, "c"), (7, "d")].into_iter().collect();
        let found = [0, 6, 7, 8, 65_534, 65_535, 65_536].map(|number| table.get(number).copied());
        assert_eq!(found, [Some("c"), None, Some("d"), None, None, Some("b"), None]);
        assert_eq!(OpcodeTable::<u8>::from_iter([]).get(0), None);
    }
}
