//! `[expect.stable]`: the outputs must not depend on rounding.

use crate::expect::Difference;
use crate::stability::{Envelope, Instability, Perturbation};
use anyhit_base::error::Result;
use anyhit_scene::read::{Parse, Span, Table, TomlValue};

/// `[expect.stable]`: what must not depend on rounding.
#[derive(Clone, Debug)]
pub struct StableExpectation {
    /// The position of the table in the scene file.
    pub span: Span,
    /// How runs are perturbed.
    pub perturbation: Perturbation,
    /// Whether branches must go the same way in every run, too.
    pub branches: bool,
    /// The reason for the expectation.
    pub because: Option<String>,
}

impl Parse for StableExpectation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let default = Perturbation::default();
        let runs = table.or("runs", default.runs);
        let perturbation = Perturbation {
            runs,
            first_run: 1,
            seed: table.or("seed", default.seed),
            envelope: table.or("envelope", Envelope::default()),
            tolerance: table.or("tolerance", default.tolerance),
        };
        let branches = table.or("branches", false);
        let because = table.optional("because");
        table.finish();
        if runs == 0 {
            return value.wrong("at least one run is needed");
        }
        Some(Self { span: value.span(), perturbation, branches, because })
    }
}

impl StableExpectation {
    /// Adds a difference for each output or branch that is not stable.
    pub fn check(&self, found: &Result<Instability>, differences: &mut Vec<Difference>) {
        let found = match found {
            Ok(found) => found,
            Err(error) => {
                let error = error.clone().at(self.span.place());
                return differences.push(Difference::of(error));
            }
        };
        let because = self.because.as_ref();
        let mut lines = found.output_lines();
        if !lines.is_empty() || self.branches {
            lines.extend(found.branch_lines());
        }
        let new = |line: String| Difference::new(&self.span, format!("not stable: {line}"), because);
        differences.extend(lines.into_iter().map(new));
    }
}
