//! The set of few elements.

use std::borrow::Borrow;
use std::fmt;
use std::ops::RangeInclusive;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::sorted::sort;

/// A set in ascending order, for few elements.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SortedSet<T> {
    elements: Vec<T>,
}

impl<T> SortedSet<T> {
    /// A set without elements.
    #[must_use]
    pub const fn new() -> Self {
        Self { elements: Vec::new() }
    }

    /// How many elements there are.
    pub fn len(&self) -> usize {
        self.elements.len()
    }

    /// Whether there is no element.
    pub fn is_empty(&self) -> bool {
        self.elements.is_empty()
    }

    /// The elements in ascending order.
    pub fn iter(&self) -> std::slice::Iter<'_, T> {
        self.elements.iter()
    }

    /// The greatest element.
    pub fn last(&self) -> Option<&T> {
        self.elements.last()
    }
}

impl<T: Ord> SortedSet<T> {
    /// Where an element is, or where it belongs.
    fn place<Q: Ord + ?Sized>(&self, element: &Q) -> Result<usize, usize>
    where
        T: Borrow<Q>,
    {
        // Elements are mostly added in ascending order.
        match self.elements.last() {
            Some(last) if last.borrow() < element => Err(self.elements.len()),
            _ => self.elements.binary_search_by(|own| own.borrow().cmp(element)),
        }
    }

    /// Whether an element is in the set.
    pub fn contains<Q: Ord + ?Sized>(&self, element: &Q) -> bool
    where
        T: Borrow<Q>,
    {
        self.place(element).is_ok()
    }

    /// Adds an element; returns whether it is new.
    pub fn insert(&mut self, element: T) -> bool {
        let place = self.place(&element);
        if let Err(at) = place {
            self.elements.insert(at, element);
        }
        place.is_err()
    }

    /// The elements from one to another.
    pub fn range(&self, range: RangeInclusive<T>) -> &[T] {
        let from = self.elements.partition_point(|element| element < range.start());
        let behind = self.elements.partition_point(|element| element <= range.end());
        &self.elements[from..behind.max(from)]
    }

    /// The elements that another set has, too.
    pub fn intersection<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = &'a T> {
        self.elements.iter().filter(|element| other.contains(*element))
    }

    /// The elements that another set does not have.
    pub fn difference<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = &'a T> {
        self.elements.iter().filter(|element| !other.contains(*element))
    }
}

impl<'a, T> IntoIterator for &'a SortedSet<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.elements.iter()
    }
}

impl<T> IntoIterator for SortedSet<T> {
    type Item = T;
    type IntoIter = std::vec::IntoIter<T>;

    fn into_iter(self) -> Self::IntoIter {
        self.elements.into_iter()
    }
}

impl<T> Default for SortedSet<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: fmt::Debug> fmt::Debug for SortedSet<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self).finish()
    }
}

impl<T: Ord> FromIterator<T> for SortedSet<T> {
    fn from_iter<I: IntoIterator<Item = T>>(elements: I) -> Self {
        let mut elements: Vec<T> = elements.into_iter().collect();
        sort(&mut elements);
        elements.dedup();
        Self { elements }
    }
}

impl<T: Ord, const N: usize> From<[T; N]> for SortedSet<T> {
    fn from(elements: [T; N]) -> Self {
        Self::from_iter(elements)
    }
}

impl<T: Ord> Extend<T> for SortedSet<T> {
    fn extend<I: IntoIterator<Item = T>>(&mut self, elements: I) {
        for element in elements {
            self.insert(element);
        }
    }
}

impl<T: Serialize> Serialize for SortedSet<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.elements.serialize(serializer)
    }
}

impl<'de, T: Ord + Deserialize<'de>> Deserialize<'de> for SortedSet<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Vec::deserialize(deserializer).map(|elements| elements.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_in_order_and_single() {
        let mut set = SortedSet::from([3, 1, 2, 1]);
        assert_eq!((set.insert(2), set.insert(0)), (false, true));
        assert_eq!(set.iter().copied().collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert_eq!((set.contains(&2), set.contains(&4), set.len()), (true, false, 4));
        assert_eq!(set.last(), Some(&3));
        assert_eq!((set.range(1..=2), set.range(3..=9)), (&[1, 2][..], &[3][..]));
        let other = SortedSet::from([3, 4]);
        assert_eq!(set.intersection(&other).collect::<Vec<_>>(), [&3]);
        assert_eq!(set.difference(&other).collect::<Vec<_>>(), [&0, &1, &2]);
        assert_eq!(format!("{set:?}"), "{0, 1, 2, 3}");
    }

    #[test]
    fn a_set_is_read_and_written_as_a_list() {
        let set = SortedSet::from(["b".to_owned(), "a".to_owned()]);
        let text = serde_json::to_string(&set).expect("JSON");
        assert_eq!(text, r#"["a","b"]"#);
        assert_eq!(serde_json::from_str::<SortedSet<String>>(&text).expect("a set"), set);
    }
}
