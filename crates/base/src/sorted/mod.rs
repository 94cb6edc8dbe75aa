//! Maps and sets of few entries, as vectors in ascending order of their keys, objects of JSON, and
//! sorting of few items.
//!
//! They have the methods of `BTreeMap`, `BTreeSet` and slices that this crate uses, and compile to
//! a tenth of the code for each type. In return, an insertion before other entries moves them, and
//! sorting takes a call for each comparison. So these are for what a scene, a module or a report
//! names, not for what a launch does.

#[cfg(feature = "compilers")]
mod json;
mod map;
mod set;
mod sort;

#[cfg(feature = "compilers")]
pub use json::json_object;
pub use map::{MapEntry, MapIter, SortedMap};
pub use set::SortedSet;
pub use sort::{sort, sort_by, sort_by_key};
