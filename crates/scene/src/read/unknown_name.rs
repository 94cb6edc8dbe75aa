//! The error of a name in a scene file that nothing has.

use crate::read::Spanned;
use anyhit_base::error::Error;
use anyhit_base::error::names::{list_of, nearest};

/// The error of a name that nothing has: it suggests the nearest of those that there are, else says
/// `otherwise`, and lists them.
pub fn unknown_name<'n, N: Iterator<Item = &'n str>>(
    name: &Spanned<String>,
    message: String,
    otherwise: &str,
    names: impl Fn() -> N,
) -> Error {
    let label = match nearest(&name.value, names()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => otherwise.to_owned(),
    };
    let error = name.span.error_with(message, label);
    match names().next() {
        Some(_) => error.note(format!("available: {}", list_of(names()))),
        None => error,
    }
}
