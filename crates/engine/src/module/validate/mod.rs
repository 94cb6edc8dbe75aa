//! Validation of a module as a whole: rules that a module breaks whichever entry point runs and
//! whatever its inputs are, and without which it can still be loaded.
//!
//! [`Module::validate`] returns a [`ValidationFinding`] for each broken rule. A class of rules is a
//! file of this folder. Its severity decides who reports it:
//!
//! * A **fault** ([`ValidationClass::is_fault`]) leaves the module without a defined meaning, such
//!   as members that overlap. Lowering rejects the module with `InvalidModule`, so every command
//!   and the Rust API do. Specialization can cause faults: they are computed from the current
//!   values of specialization constants and kept until [`Module::specialize`] changes one.
//! * An **undeclared requirement** is a warning of `run`, `test`, `inspect`, `render`, `smoke` and
//!   `trace-one-ray`, once per module, since drivers run such modules. With `--strict` it is an
//!   error. Lowering does not look for it.
//!
//! To add a class of rules:
//!
//! 1. a variant of [`ValidationClass`], with its name and severity;
//! 2. a file `validate/<class>.rs` with `pub(super) fn check(module: &Module) ->
//!    Vec<ValidationFinding>`, linear in the words of the module, which must not panic on any
//!    module that [`load()`](crate::module::load()) accepts;
//! 3. a row in `FAULTS` or `REQUIREMENTS`;
//! 4. the wording by which the judge recognises the class in SPIRV-Tools' messages, in
//!    `judges/src/validation.rs`.

mod declared;
mod entry;
pub mod explicit_layout;
#[rustfmt::skip]
mod grammar_delta;
pub mod layout;
mod missing;
mod report;
mod requirement;
#[cfg(test)]
mod requirement_tests;
mod requirements;
mod runtime_array;
mod universal;

pub(crate) use requirement::{capability_name, enumerant_name};

use serde::Serialize;

use crate::module::{Id, Module};

/// A check of one class of rules.
type Check = fn(&Module) -> Vec<ValidationFinding>;

/// Checks whose findings make the module invalid.
const FAULTS: &[Check] = &[layout::check];

/// Checks of what the module uses without declaring it.
const REQUIREMENTS: &[Check] = &[requirements::check];

/// Class of a rule that a module breaks as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ValidationClass {
    /// An instruction, type or operand requires a capability that the module does not declare.
    Capability,
    /// An instruction, operand or capability requires an extension or a version of SPIR-V that the
    /// module does not declare.
    Extension,
    /// The members of a struct, the elements of an array or the columns of a matrix overlap, or
    /// break the alignment of their storage class.
    Layout,
}

impl ValidationClass {
    /// Name in diagnostics and JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Capability => "capability",
            Self::Extension => "extension",
            Self::Layout => "layout",
        }
    }

    /// Returns true if a module that breaks such a rule is rejected; false if that is a warning
    /// unless the caller is strict.
    #[must_use]
    pub fn is_fault(self) -> bool {
        match self {
            Self::Capability | Self::Extension => false,
            Self::Layout => true,
        }
    }
}

/// A rule that a module breaks as a whole, returned by [`Module::validate`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ValidationFinding {
    /// Class of the rule.
    pub class: ValidationClass,
    /// The instruction, type, operand or member that breaks it, as the specification or the module
    /// names it.
    pub name: String,
    /// Source of the rule: a section of the SPIR-V specification, a VUID or an extension.
    pub rule: String,
    /// Offset of the offending word, counted from the first word of the module.
    pub word: usize,
    /// Result id of the offending instruction, or the id that it decorates; `None` where it has
    /// neither.
    pub id: Option<u32>,
    /// The message, one line, without place and rule.
    pub message: String,
    /// The fix as an imperative, one line.
    pub fix: String,
}

impl ValidationFinding {
    /// Creates a finding at a word of the module.
    pub(crate) fn new(
        class: ValidationClass,
        name: impl Into<String>,
        rule: impl Into<String>,
        (word, id): (usize, Option<Id>),
        message: impl Into<String>,
        fix: impl Into<String>,
    ) -> Self {
        let id = id.map(|id| id.0);
        Self {
            class,
            name: name.into(),
            rule: rule.into(),
            word,
            id,
            message: message.into(),
            fix: fix.into(),
        }
    }
}

impl Module {
    /// Returns every rule that the module breaks as a whole, in the order of the offending words:
    /// undeclared capabilities and extensions, and layouts without a defined meaning under the
    /// current values of specialization constants.
    ///
    /// Each distinct instruction, operand or type is reported once per missing requirement, at its
    /// first place. The time is linear in the size of the module.
    ///
    /// ```
    /// use anyhit::{Module, ValidationClass};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// // Version 1.6, `OpCapability Shader`, `OpMemoryModel Logical GLSL450`, `%1 = OpTypeFloat 64`.
    /// let words = [0x0723_0203, 0x0001_0600, 0, 2, 0, 0x0002_0011, 1, 0x0003_000e, 0, 1, 0x0003_0016, 1, 64];
    /// let bytes: Vec<u8> = words.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
    /// let findings = Module::from_spirv(&bytes)?.validate();
    /// assert_eq!(findings[0].class, ValidationClass::Capability);
    /// assert_eq!((findings[0].word, findings[0].id), (10, Some(1)));
    /// assert_eq!(findings[0].fix, "declare `OpCapability Float64`");
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn validate(&self) -> Vec<ValidationFinding> {
        let mut all = [self.faults(), self.undeclared()].concat();
        all.sort_by_key(|finding| (finding.word, finding.class));
        all
    }

    /// The findings that make the module invalid, computed once for each set of specialization
    /// values.
    pub(crate) fn faults(&self) -> &[ValidationFinding] {
        self.faults.get_or_init(|| FAULTS.iter().flat_map(|check| check(self)).collect())
    }

    /// What the module uses without declaring it, in the order of the words, computed once.
    pub(crate) fn undeclared(&self) -> &[ValidationFinding] {
        self.undeclared.get_or_init(|| {
            let mut all: Vec<_> = REQUIREMENTS.iter().flat_map(|check| check(self)).collect();
            all.sort_by_key(|finding| (finding.word, finding.class));
            all
        })
    }
}
