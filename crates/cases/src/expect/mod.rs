//! `[expect]`: what a scene's launch must leave behind, and the comparison.
//!
//! A table may name its reason (`because`: a section of a specification, a VUID, arithmetic): then
//! its values are derived, and nothing ever rewrites them. Every number knows its place in the
//! file, so that a difference is shown with line and caret, and so that a recorded one can be
//! renewed.

mod bytes;
mod difference;
mod hit;
mod normal;
mod numbers;
mod payload;
mod picture;
mod printed;
mod ray;
mod similarity;
mod stats;
mod trap;

pub use bytes::{BytesExpectation, ObservedMemory};
pub use difference::{Difference, Fix, PictureDifference, Subject, magnitude_colour};
pub use hit::{HitExpectation, RayFound};
pub use normal::NormalExpectation;
pub use payload::PayloadExpectation;
pub use picture::{Measure, PictureExpectation};
pub use printed::PrintedExpectation;
pub(crate) use printed::diff as printed_diff;
pub use ray::{FoundExpectation, OneRay, RayExpectation};
pub use stats::StatsExpectation;
pub use trap::{TrapExpectation, TrapName};

use crate::cost::Costs;
use crate::stability::{Instability, StableExpectation};
use anyhit_base::error::{Error, Result};
use anyhit_engine::pipeline::Stats;
use anyhit_scene::SceneFiles;
use anyhit_scene::read::{Diagnostics, Document, Parse, Span, Spanned, Table, TomlValue};
use anyhit_unit_test::number::Tolerance;

/// All that `[expect]` says, or that `[ray.expect]` says beside the hit and the payload.
#[derive(Clone, Debug, Default)]
pub struct Expectations {
    /// Why the case is known to fail; it must fail then.
    pub known_failure: Option<Spanned<String>>,
    /// `[expect.trap]`
    pub trap: Option<TrapExpectation>,
    /// `[[expect.buffer]]`
    pub buffers: Vec<BytesExpectation>,
    /// `[[expect.image]]` with numbers.
    pub images: Vec<BytesExpectation>,
    /// `[[expect.image]]` with a file.
    pub pictures: Vec<PictureExpectation>,
    /// `[[expect.ray]]`
    pub rays: Vec<RayExpectation>,
    /// `[expect.stats]`
    pub stats: Option<StatsExpectation>,
    /// `stdout`
    pub printed: Option<PrintedExpectation>,
    /// `[expect.stable]`
    pub stable: Option<StableExpectation>,
    /// Notes for the author, a line each: old names that the table uses.
    pub notes: Vec<String>,
}

/// What a launch left behind, or a ray.
#[derive(Clone, Debug, Default)]
pub struct Observed {
    /// The trap of the lowest launch index.
    pub trap: Option<Error>,
    /// Every buffer.
    pub buffers: Vec<ObservedMemory>,
    /// Every image.
    pub images: Vec<ObservedMemory>,
    /// What became of each `[[ray]]`: its name and what it found, or its trap.
    pub rays: Vec<(Option<String>, Result<RayFound>)>,
    /// What was done; `None` where the launch trapped.
    pub stats: Option<Stats>,
    /// What shaders printed, a line each, in launch order.
    pub printed: String,
    /// What rays cost, where an expectation asks.
    pub costs: Option<Costs>,
    /// What depends on rounding, where an expectation needs it.
    pub stability: Option<Result<Instability>>,
}

impl Expectations {
    /// Reads `[expect]`; a scene without it expects nothing but to run without a trap.
    ///
    /// # Errors
    /// All mistakes of the table as one error.
    pub fn read(document: &Document) -> Result<Self> {
        let report = Diagnostics::default();
        let root = document.root(&report);
        let read = root.value("expect").map_or(Some(Self::default()), Self::parse);
        drop(root);
        let notes = report.take_notes();
        report.finish()?;
        let read = read.expect("bug in anyhit: expectations failed without an error");
        Ok(Self { notes, ..read })
    }

    /// Reads expected pictures in this way.
    pub fn read_with(&mut self, files: &SceneFiles) {
        self.pictures.iter_mut().for_each(|picture| picture.files = files.clone());
    }

    /// Whether nothing is expected beside a launch without a trap.
    pub fn is_empty(&self) -> bool {
        self.trap.is_none()
            && self.stats.is_none()
            && self.buffers.is_empty()
            && self.images.is_empty()
            && self.pictures.is_empty()
            && self.rays.is_empty()
            && self.printed.is_none()
            && self.stable.is_none()
    }

    /// Whether what rays cost must be counted.
    pub fn wants_costs(&self) -> bool {
        self.stats.as_ref().is_some_and(StatsExpectation::wants_costs)
    }

    /// The tables that give no reason, for suites that record nothing.
    pub fn without_reason(&self) -> Vec<Span> {
        let bytes = self.buffers.iter().chain(&self.images);
        let tables = bytes.map(|one| (&one.name.span, one.because.is_some()));
        let tables = tables.chain(self.rays.iter().map(|ray| (&ray.name.span, ray.check.because.is_some())));
        let tables = tables.chain(self.trap.iter().map(|trap| (&trap.code.span, trap.because.is_some())));
        let stable = self.stable.iter().map(|stable| (&stable.span, stable.because.is_some()));
        let tables = tables.chain(stable);
        let stats = self.stats.iter().map(|stats| (&stats.span, stats.because.is_some()));
        let tables = tables.chain(stats);
        tables.filter(|(_, reason)| !reason).map(|(span, _)| span.clone()).collect()
    }

    /// Whether what a run left in a resource meets all that is expected of it, some of which within
    /// a tolerance.
    pub fn tolerates(&self, name: &str, observed: &Observed) -> bool {
        let (mut gives_tolerance, mut found) = (false, Vec::new());
        for (what, list, memory) in
            [("buffer", &self.buffers, &observed.buffers), ("image", &self.images, &observed.images)]
        {
            for expectation in list.iter().filter(|one| one.name.value == name) {
                gives_tolerance |= expectation.tolerance != Tolerance::Exact;
                expectation.check(what, memory, &mut found);
            }
        }
        for picture in self.pictures.iter().filter(|one| one.name.value == name) {
            gives_tolerance |= picture.measure != Measure::Each(Tolerance::Exact);
            picture.check(&observed.images, &mut found);
        }
        gives_tolerance && found.is_empty()
    }

    /// Compares; no error where everything holds, or where a known failure still fails.
    ///
    /// # Errors
    /// `Expectation` with every difference at its place in the scene file.
    pub fn check(&self, observed: &Observed) -> Result<()> {
        let differences = self.differences(observed);
        if differences.is_empty() {
            return Ok(());
        }
        Err(Difference::as_error(differences))
    }

    /// Compares; nothing where everything holds, or where a known failure still fails.
    pub fn differences(&self, observed: &Observed) -> Vec<Difference> {
        let found = self.all_differences(observed);
        match &self.known_failure {
            Some(_) if !found.is_empty() => Vec::new(),
            Some(reason) => {
                let message = "this known failure passes: remove `known_failure`";
                vec![Difference::new(&reason.span, message, Some(&reason.value))]
            }
            None => found,
        }
    }

    /// Compares, whether failures are known or not.
    pub fn all_differences(&self, observed: &Observed) -> Vec<Difference> {
        let mut found = Vec::new();
        self.check_trap(observed, &mut found);
        // What the launch did before an unexpected trap is not compared.
        if self.trap.is_none() && observed.trap.is_some() {
            return found;
        }
        for (what, list, memory) in
            [("buffer", &self.buffers, &observed.buffers), ("image", &self.images, &observed.images)]
        {
            for expectation in list {
                expectation.check(what, memory, &mut found);
            }
        }
        for picture in &self.pictures {
            picture.check(&observed.images, &mut found);
        }
        for ray in &self.rays {
            ray.check(observed, &mut found);
        }
        if let Some(stats) = &self.stats {
            stats.check(observed, &mut found);
        }
        if let Some(printed) = &self.printed {
            printed.check(&observed.printed, &mut found);
        }
        if let (Some(stable), Some(stability)) = (&self.stable, &observed.stability) {
            stable.check(stability, &mut found);
        }
        found
    }

    fn check_trap(&self, observed: &Observed, found: &mut Vec<Difference>) {
        match (&self.trap, &observed.trap) {
            (None, None) => {}
            (None, Some(trap)) => {
                let subject = trap::invocation(trap);
                found.push(Difference::of(trap.clone().context("a shader trapped")).about(subject));
            }
            (Some(expected), None) => {
                let message = format!("no trap; expected: {}", expected.code.value.0.message());
                found.push(Difference::new(&expected.code.span, message, expected.because.as_ref()));
            }
            (Some(expected), Some(trap)) => expected.check(trap, found),
        }
    }

    /// The keys that launches and rays have in common.
    fn of(table: &Table<'_>) -> Option<Self> {
        let known_failure = table.optional("known_failure");
        let trap = table.optional("trap");
        let buffers = table.or("buffer", Vec::new());
        let mut images = Vec::new();
        let mut pictures = Vec::new();
        if let Some(list) = table.value("image") {
            let Some(elements) = list.elements() else { return list.expected("an array") };
            for element in elements {
                let is_file = Table::new(element).is_some_and(|table| table.has("file"));
                match is_file {
                    true => pictures.extend(PictureExpectation::parse(element)),
                    false => images.extend(BytesExpectation::parse(element)),
                }
            }
        }
        let stats = table.optional("stats");
        let printed = table.optional("stdout");
        let stable = table.optional("stable");
        Some(Self {
            known_failure,
            trap,
            buffers,
            images,
            pictures,
            rays: Vec::new(),
            stats,
            printed,
            stable,
            notes: Vec::new(),
        })
    }
}

impl Parse for Expectations {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let common = Self::of(&table);
        let rays = table.or("ray", Vec::new());
        table.finish();
        Some(Self { rays, ..common? })
    }
}

#[cfg(test)]
mod tests;
