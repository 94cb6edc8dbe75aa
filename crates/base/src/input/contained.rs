//! Panics of readers that are not ours, caught as errors of the file that they read.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, Location, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use crate::error::{Error, ErrorKind, Result};

thread_local! {
    /// What panicked inside [`contained`] on this thread; `None` outside of it.
    static INSIDE: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Makes the panic hook silent on threads that are inside [`contained`]; all others keep the hook
/// that was there.
fn install_hook() {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            let told = INSIDE.try_with(|inside| match &mut *inside.borrow_mut() {
                Some(told) => {
                    *told = panic.location().map(in_package).unwrap_or_default();
                    true
                }
                None => false,
            });
            if told != Ok(true) {
                before(panic);
            }
        }));
    });
}

/// The place of a panic from the folder of its package on: what is before it is of the machine on
/// which the program was built.
fn in_package(location: &Location<'_>) -> String {
    let path = location.file().replace('\\', "/");
    // The paths of these crates are relative, or absolute where another workspace compiles them.
    let root = env!("CARGO_MANIFEST_DIR").replace('\\', "/");
    let own = path.strip_prefix(root.strip_suffix("/crates/base").unwrap_or(&root));
    let path = own.map_or(&*path, |own| own.trim_start_matches('/'));
    if !path.starts_with('/') && !path.contains(":/") {
        return format!("{path}:{}:{}", location.line(), location.column());
    }
    let folders: Vec<&str> = path.split('/').collect();
    let source = folders.iter().rposition(|&folder| folder == "src").unwrap_or(folders.len());
    let path = folders[source.saturating_sub(1).min(folders.len() - 1)..].join("/");
    format!("{path}:{}:{}", location.line(), location.column())
}

/// Runs a reader of another crate. A panic in it, of which nothing is printed, becomes an error of
/// the file: such readers assume rules that a broken file breaks.
///
/// The work must leave nothing behind that a panic could leave half done. A program that is built
/// with `panic = "abort"` ends at the panic.
///
/// # Errors
/// Of the given kind, with the panic's message and place, and otherwise those of the work.
pub fn contained<T>(reader: &str, kind: ErrorKind, work: impl FnOnce() -> Result<T>) -> Result<T> {
    install_hook();
    // A reader inside a reader: the inner one gives its place back.
    let outer = INSIDE.with(|inside| inside.replace(Some(String::new())));
    let ended = catch_unwind(AssertUnwindSafe(work));
    let place = INSIDE.with(|inside| inside.replace(outer)).unwrap_or_default();
    ended.unwrap_or_else(|panic| {
        let words = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let words = words.or_else(|| panic.downcast_ref::<String>().cloned());
        let words = words.unwrap_or_else(|| "it panicked".to_owned());
        let message = format!("the reader `{reader}` failed: {words}");
        Err(Error::new(kind, message).note(format!("the file violates an assumption at `{place}`")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(list: &[u8], at: usize) -> Result<u8> {
        contained("a-reader", ErrorKind::InvalidMesh, || Ok(list[at]))
    }

    #[test]
    fn a_panic_is_an_error_with_its_words_and_place() {
        assert_eq!(index(&[4], 0).unwrap(), 4);
        let error = index(&[4], 1).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidMesh);
        let words = "the reader `a-reader` failed: index out of bounds: the len is 1";
        assert!(error.message().starts_with(words), "{error}");
        assert!(error.notes()[0].contains("contained.rs:"), "{error}");
        // The next one starts anew, and an error stays what it is.
        assert_eq!(index(&[4], 0).unwrap(), 4);
        let own = contained("a-reader", ErrorKind::InvalidMesh, || {
            Err::<(), _>(Error::new(ErrorKind::Io, "a disk"))
        });
        assert_eq!(own.unwrap_err().kind(), ErrorKind::Io);
    }

    #[test]
    fn one_inside_another_gives_its_place_back() {
        let error = contained("outer", ErrorKind::InvalidScene, || {
            assert!(index(&[], 0).is_err());
            let none = [0_u8; 0].first();
            Ok(*none.expect("a number"))
        });
        assert!(error.unwrap_err().message().contains("`outer` failed: a number"));
    }

    /// The doors rely on unwinding, which a profile of this package may not take away.
    #[test]
    fn no_profile_aborts_on_a_panic() {
        let manifest = include_str!("../../../../Cargo.toml");
        assert!(!manifest.lines().any(|line| line.trim_start().starts_with("panic")), "panic = ...");
    }
}
