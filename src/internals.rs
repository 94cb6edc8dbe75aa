//! The rooms of the crate by their own names, for its program, tests, benchmarks, fuzzers, judges
//! and the wheel for Python. Nothing here is promised: a version may change or remove all of it.

/// Each room with all that is public in it.
macro_rules! rooms {
    ($($(#[$attribute:meta])* $room:ident)*) => {
        $(
            #[allow(missing_docs, reason = "described where it stands")]
            $(#[$attribute])*
            pub mod $room {
                pub use crate::$room::*;
            }
        )*
    };
}

rooms! {
    accel
    #[cfg(feature = "stress")] check_math
    #[cfg(feature = "cli")] cli
    compile
    debug
    #[cfg(feature = "cli")] drawing
    error
    escape
    geometry
    harness
    input
    interp
    machine
    math
    module
    ops
    pipeline
    program
    #[cfg(feature = "recordings")] recording
    sanitize
    #[cfg(feature = "scenes")] scene
    sorted
    #[cfg(feature = "stress")] stress
}
