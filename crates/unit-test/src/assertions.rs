//! Assertions on results of shaders. A failure prints the numbers and their distance, the fields
//! that differ, and an explanation of the ray or the shader run.
//!
//! [`assert_ulps!`](crate::assert_ulps), [`assert_near!`](crate::assert_near) and
//! [`assert_payload_eq!`](crate::assert_payload_eq). A value taken by name
//! (`outcome.payload["normal"]`) knows where it comes from; for plain floats the outcome can be
//! given as the last argument.

use std::fmt::Debug;
use std::io::IsTerminal;

use bytemuck::{AnyBitPattern, NoUninit};
use pretty_assertions::StrComparison;

use crate::data::{HostBytes, TypedBytes};
use crate::explain::Explain;
use crate::number::{ExpectedNumber, NumberType, Tolerance};
use crate::shader_outcome::ShaderOutcome;
use crate::trace::Traced;
use crate::value::Value;
use anyhit_base::error::Result;

/// Asserts that numbers are at most so many units in the last place away: `assert_ulps!(found,
/// expected, 1)`.
///
/// Found is a number, an array of them, or a [`Value`]; expected a number or an array. The unit is
/// that of the type found, in the binade of the expected value, which may be an `f64` and is not
/// rounded: with it, 0.5 asks for correct rounding. Integers are compared exactly, in units of 1.
/// An infinity is near itself alone, and a NaN is near every NaN.
///
/// ```
/// use anyhit::assert_ulps;
///
/// assert_ulps!(1.0f32 / 3.0, 1.0 / 3.0f64, 0.5);
/// assert_ulps!([0.0f32, 1.0 + f32::EPSILON], [0.0, 1.0], 1);
/// ```
#[macro_export]
macro_rules! assert_ulps {
    ($found:expr, $expected:expr, $ulps:expr $(, $outcome:expr)? $(,)?) => {
        $crate::assertions::near(
            &$found,
            &$expected,
            &[$crate::number::Tolerance::Ulp(f64::from($ulps))],
            stringify!($found),
            $crate::assert_near!(@outcome $($outcome)?),
        )
    };
}

/// Asserts that numbers are near each other: `assert_near!(found, expected, absolute = 1e-6)`, or
/// `relative = 1e-6`, or both, of which one must hold.
///
/// What it takes is as in [`assert_ulps!`](crate::assert_ulps).
///
/// ```
/// use anyhit::assert_near;
///
/// assert_near!(100.0f32 * 1.00001, 100.0, relative = 2e-5);
/// assert_near!([1e-9f32, 100.001], [0.0, 100.0], absolute = 1e-6, relative = 2e-5);
/// ```
#[macro_export]
macro_rules! assert_near {
    (@outcome) => {
        None
    };
    (@outcome $outcome:expr) => {
        Some(&$outcome)
    };
    (@ absolute $bound:expr) => {
        $crate::number::Tolerance::Absolute($bound)
    };
    (@ relative $bound:expr) => {
        $crate::number::Tolerance::Relative($bound)
    };
    ($found:expr, $expected:expr, $kind:ident = $bound:expr, $other:ident = $second:expr $(, $outcome:expr)? $(,)?) => {
        $crate::assertions::near(
            &$found,
            &$expected,
            &[$crate::assert_near!(@ $kind $bound), $crate::assert_near!(@ $other $second)],
            stringify!($found),
            $crate::assert_near!(@outcome $($outcome)?),
        )
    };
    ($found:expr, $expected:expr, $kind:ident = $bound:expr $(, $outcome:expr)? $(,)?) => {
        $crate::assertions::near(
            &$found,
            &$expected,
            &[$crate::assert_near!(@ $kind $bound)],
            stringify!($found),
            $crate::assert_near!(@outcome $($outcome)?),
        )
    };
}

/// Asserts that the payload of an outcome equals what is expected: as a plain Rust type, or by the
/// paths of members, others than which may be anything. Zeros of both signs are equal, and so are
/// equal bits, a NaN's too.
///
/// ```
/// use anyhit::{Hit, Module, Ray, ShaderTest, assert_payload_eq};
///
/// # fn main() -> anyhit::Result<()> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
/// let module = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
/// let hit = Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
/// let outcome = ShaderTest::new(&module, "main")?.hit(hit).run()?;
/// assert_payload_eq!(outcome, { "normal": [0.0f32, 0.0, 1.0], "t": 3.5f32 });
///
/// #[repr(C)]
/// #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
/// struct Payload {
///     normal: [f32; 3],
///     t: f32,
///     hits: u32,
/// }
/// assert_payload_eq!(outcome, Payload { normal: [0.0, 0.0, 1.0], t: 3.5, hits: 1 });
/// # Ok(())
/// # }
/// ```
#[macro_export]
macro_rules! assert_payload_eq {
    ($outcome:expr, { $($path:literal : $expected:expr),+ $(,)? }) => {
        $crate::assertions::members_eq(&$outcome, |payload| {
            $(payload.set($path, $expected)?;)+
            Ok(())
        })
    };
    ($outcome:expr, $expected:expr $(,)?) => {
        $crate::assertions::payload_eq(&$outcome, &$expected)
    };
}

/// What has numbers to compare.
#[doc(hidden)]
pub trait AsNumbers {
    /// Kind and bits of each.
    fn numbers(&self) -> Vec<(NumberType, u64)>;

    /// What led to them, where that is known.
    fn explanation(&self) -> Option<String> {
        None
    }
}

macro_rules! as_numbers {
    ($($ty:ty => $variant:ident, |$value:ident| $bits:expr;)*) => {$(
        impl AsNumbers for $ty {
            fn numbers(&self) -> Vec<(NumberType, u64)> {
                let $value = *self;
                vec![(NumberType::$variant, $bits)]
            }
        }
    )*};
}

as_numbers! {
    f32 => F32, |value| value.to_bits().into();
    f64 => F64, |value| value.to_bits();
    half::f16 => F16, |value| value.to_bits().into();
    half::bf16 => Bf16, |value| value.to_bits().into();
    u8 => U8, |value| value.into();
    u16 => U16, |value| value.into();
    u32 => U32, |value| value.into();
    u64 => U64, |value| value;
    i8 => I8, |value| (value as u8).into();
    i16 => I16, |value| (value as u16).into();
    i32 => I32, |value| (value as u32).into();
    i64 => I64, |value| value as u64;
}

impl<T: AsNumbers> AsNumbers for [T] {
    fn numbers(&self) -> Vec<(NumberType, u64)> {
        self.iter().flat_map(AsNumbers::numbers).collect()
    }
}

impl<T: AsNumbers, const N: usize> AsNumbers for [T; N] {
    fn numbers(&self) -> Vec<(NumberType, u64)> {
        self[..].numbers()
    }
}

impl<T: AsNumbers> AsNumbers for Vec<T> {
    fn numbers(&self) -> Vec<(NumberType, u64)> {
        self[..].numbers()
    }
}

impl<T: AsNumbers + ?Sized> AsNumbers for &T {
    fn numbers(&self) -> Vec<(NumberType, u64)> {
        (**self).numbers()
    }

    fn explanation(&self) -> Option<String> {
        (**self).explanation()
    }
}

impl AsNumbers for Value {
    fn numbers(&self) -> Vec<(NumberType, u64)> {
        Value::numbers(self)
    }

    fn explanation(&self) -> Option<String> {
        Some(self.explain()).filter(|text| !text.is_empty())
    }
}

/// What [`assert_ulps!`](crate::assert_ulps) and [`assert_near!`](crate::assert_near) call.
///
/// # Panics
/// Where a number is outside all tolerances, or their count differs.
#[doc(hidden)]
#[track_caller]
pub fn near(
    found: &impl AsNumbers,
    expected: &impl AsNumbers,
    tolerances: &[Tolerance],
    what: &str,
    outcome: Option<&dyn Explain>,
) {
    let (numbers, wanted) = (found.numbers(), expected.numbers());
    let mut wrong = Vec::new();
    if numbers.len() != wanted.len() {
        wrong.push(format!("found {} numbers, expected {}", numbers.len(), wanted.len()));
    }
    for (at, (&(scalar, bits), &(kind, expected))) in numbers.iter().zip(&wanted).enumerate() {
        let differs = |tolerance: &Tolerance| match (scalar.integer(bits), kind.integer(expected)) {
            (Some(found), wanted) => {
                tolerance.integer_difference(found, wanted.ok_or_else(|| kind.value(expected)))
            }
            (None, wanted) => {
                let exact = wanted.map_or_else(|| kind.value(expected), |wanted| wanted as f64);
                let rounded = scalar.format().map_or(0, |format| format.round(exact));
                tolerance.difference(scalar, &ExpectedNumber::Number(rounded, exact), bits)
            }
        };
        let differences: Vec<_> = tolerances.iter().filter_map(differs).collect();
        if differences.len() == tolerances.len() {
            let at = if numbers.len() > 1 { format!("[{at}]: ") } else { String::new() };
            wrong.push(format!("{at}{}", differences.join("; ")));
        }
    }
    if wrong.is_empty() {
        return;
    }
    let explanation = found.explanation().or_else(|| outcome.map(Explain::explain));
    panic!("`{what}` is not as expected\n  {}{}", wrong.join("\n  "), beneath(explanation));
}

fn beneath(explanation: Option<String>) -> String {
    explanation.map_or_else(String::new, |explanation| format!("\n\n{explanation}"))
}

/// An outcome with a payload.
#[doc(hidden)]
pub trait HasPayload: Explain {
    /// The payload as a plain Rust type.
    ///
    /// # Errors
    /// `InvalidArgument` where size or types differ.
    fn read_payload<T: AnyBitPattern + Debug>(&self) -> Result<T>;

    /// The payload, to be changed.
    fn payload_data(&self) -> Option<&TypedBytes>;
}

macro_rules! has_payload {
    ($($outcome:ty),*) => {$(
        impl HasPayload for $outcome {
            fn read_payload<T: AnyBitPattern + Debug>(&self) -> Result<T> {
                self.payload()
            }

            fn payload_data(&self) -> Option<&TypedBytes> {
                self.data.as_ref()
            }
        }
    )*};
}
has_payload!(ShaderOutcome, Traced);

/// What [`assert_payload_eq!`](crate::assert_payload_eq) calls for a Rust type.
///
/// # Panics
/// Where the payload differs, or does not fit the type.
#[doc(hidden)]
#[track_caller]
pub fn payload_eq<T>(outcome: &impl HasPayload, expected: &T)
where
    T: AnyBitPattern + NoUninit + Debug + PartialEq,
{
    let found: T = match outcome.read_payload() {
        Ok(found) => found,
        Err(error) => panic!("{}", error.render()),
    };
    let is_payload = outcome.payload_data().map_or(Ok(()), |payload| payload.check(&HostBytes::of(expected)));
    if let Err(error) = is_payload {
        panic!("{}", error.render());
    }
    if found != *expected && bytemuck::bytes_of(&found) != bytemuck::bytes_of(expected) {
        differ(&format!("{found:#?}"), &format!("{expected:#?}"), outcome);
    }
}

/// What [`assert_payload_eq!`](crate::assert_payload_eq) calls for members.
///
/// # Panics
/// Where a member differs, or there is none of its path.
#[doc(hidden)]
#[track_caller]
pub fn members_eq(outcome: &impl HasPayload, expect: impl FnOnce(&mut TypedBytes) -> Result<()>) {
    let Some(found) = outcome.payload_data() else {
        panic!("there is no payload: no shader that ran declares one\n\n{}", outcome.explain());
    };
    let mut expected = found.clone();
    if let Err(error) = expect(&mut expected) {
        panic!("{}", error.render());
    }
    if !same(&found.value(), &expected.value()) {
        differ(&format!("{:#?}", found.value()), &format!("{:#?}", expected.value()), outcome);
    }
}

/// Whether all numbers have the same bits or are equal floats.
fn same(found: &Value, expected: &Value) -> bool {
    let (found, expected) = (found.numbers(), expected.numbers());
    found.iter().zip(&expected).all(|(&(scalar, bits), &(_, other))| {
        bits == other || scalar.is_float() && scalar.value(bits) == scalar.value(other)
    })
}

#[track_caller]
fn differ(found: &str, expected: &str, outcome: &impl Explain) -> ! {
    let diff = StrComparison::new(found, expected).to_string();
    let is_read = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let diff = if is_read { diff } else { without_colours(&diff) };
    panic!("the payload is not as expected (found < > expected)\n\n{diff}\n{}", outcome.explain());
}

/// A text without the escape sequences that colour it.
fn without_colours(text: &str) -> String {
    let mut parts = text.split('\u{1b}');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| all + part.split_once('m').map_or("", |(_, rest)| rest))
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;
    use crate::hit::Hit;
    use crate::shader_test::ShaderTest;
    use anyhit_engine::geometry::Ray;
    use anyhit_engine::module::Module;

    fn outcome() -> ShaderOutcome {
        let root =
            std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("spirv-fixtures/pass");
        let module = Module::open(root.join("sphere/closest-hit/main.rchit.spv")).unwrap();
        let hit = Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -2.0]));
        ShaderTest::new(&module, "main").unwrap().hit(hit).run().unwrap()
    }

    /// The message of a failing assertion, without colours.
    fn message(assert: impl FnOnce()) -> String {
        let panic = catch_unwind(AssertUnwindSafe(assert)).expect_err("it does not fail");
        without_colours(panic.downcast_ref::<String>().expect("a formatted message"))
    }

    #[test]
    fn numbers_within_bounds_pass() {
        let outcome = outcome();
        assert_ulps!(outcome.payload["normal"], [0.0, 0.0, 1.0], 0);
        assert_near!(outcome.payload["t"], 1.7500001, relative = 1e-6);
        assert_near!(outcome.payload["t"].f32(), 1.7500001f32, absolute = 1e-6, outcome);
        assert_near!(vec![0.0f32, 1000.1], [1e-9, 1000.0], absolute = 1e-6, relative = 1e-3);
    }

    #[test]
    fn a_failure_shows_numbers_distance_and_what_the_shader_did() {
        let outcome = outcome();
        let text = message(|| assert_ulps!(outcome.payload["normal"], [0.0, 0.0, 1.0 + f32::EPSILON], 0.5));
        assert!(
            text.starts_with("`outcome.payload[\"normal\"]` is not as expected\n  [2]: expected 1.0000001"),
            "{text}"
        );
        assert!(text.contains("found 1.0 (bits 0x3f800000), 1.000 ulp away (allowed: 0.5)"), "{text}");
        assert!(text.contains("ObjectRayOriginKHR") && text.contains("HitSphereRadiusNV"), "{text}");
        let text = message(|| {
            assert_near!(outcome.payload["t"].f32(), 1.0, absolute = 0.5, relative = 0.5, outcome)
        });
        assert!(text.contains("7.5e-1 away (allowed: 5e-1); expected"), "{text}");
        assert!(text.contains("ObjectRayOriginKHR"), "{text}");
        let text = message(|| assert_ulps!([1.0f32], [1.0, 2.0], 1));
        assert!(text.contains("found 1 numbers, expected 2"), "{text}");
        let text = message(|| assert_near!(f32::NAN, 1.0, absolute = 1e9));
        assert!(text.contains("found NaN"), "{text}");
    }

    #[test]
    fn a_payload_is_compared_field_by_field() {
        let outcome = outcome();
        assert_payload_eq!(outcome, { "normal": [0.0f32, 0.0, 1.0], "hits": 1 });
        assert_payload_eq!(outcome, { "normal": [0.0f32, -0.0, 1.0] });
        let text = message(|| assert_payload_eq!(outcome, [-0.0, 0.0, 1.0, 1.75, f32::from_bits(1)]));
        assert!(text.contains("`hits` is uint, given as `f32`"), "{text}");
        let text = message(|| assert_payload_eq!(outcome, { "normal": [0.0f32, 0.0, 1.0], "hits": 2 }));
        assert!(text.contains("<    hits: 1u") && text.contains(">    hits: 2u"), "{text}");
        assert!(!text.contains("<    t:"), "{text}");
        assert!(text.contains("HitSphereRadiusNV"), "{text}");
        let text = message(|| assert_payload_eq!(outcome, { "hit": 2 }));
        assert!(text.contains("no member `hit`"), "{text}");
        let text = message(|| assert_payload_eq!(outcome, [0.0f32; 4]));
        assert!(text.contains("`[f32; 4]` has 16 bytes"), "{text}");
    }
}
