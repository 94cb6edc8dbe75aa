//! A named table of a scene.

use crate::scene::read::Spanned;

/// A named table; `None` where it has a mistake that is already reported.
#[derive(Clone, Debug)]
pub struct Entry<T> {
    /// Its name.
    pub name: Spanned<String>,
    /// Its content.
    pub content: Option<T>,
}
