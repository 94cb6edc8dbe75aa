//! How often hints about expected values hold.

use crate::cause::OpPlace;
use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::plan::ProgramPlan;
use crate::rule::{Level, arithmetic};
use anyhit_base::error::{Error, ErrorKind};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::{Batch, Mask, OpIndex, Reg, ShaderIndex};
use anyhit_engine::pipeline::with_location;

/// What came of each `OpExpectKHR`, by shader and operation.
#[derive(Debug, Default)]
pub(super) struct Expectations(SortedMap<(u32, u32), Outcome>);

/// How often an expected value came, and how often another.
#[derive(Debug, Default)]
struct Outcome {
    met: u64,
    missed: u64,
    /// The launch id of the first that missed it.
    launch_id: [u32; 3],
}

impl Outcome {
    /// Whether another value came more often, in enough invocations to tell.
    fn is_wrong(&self) -> bool {
        const FEWEST: u64 = 8;
        self.missed > self.met && self.met + self.missed >= FEWEST
    }
}

impl Expectations {
    /// Counts in which lanes a value differs from the expected one, by a register that then is not
    /// 0.
    pub(super) fn count<const W: usize>(&mut self, batch: &Batch<W>, place: OpPlace, difference: Reg) {
        let met = Mask::equal(&batch.registers[difference], 0) & batch.mask;
        let missed = batch.mask.without(met);
        let outcome = self.0.entry((place.shader.0, place.op.0)).or_default();
        if let Some(lane) = missed.lowest().filter(|_| outcome.missed == 0) {
            outcome.launch_id = batch.invocations.launch_id(lane);
        }
        outcome.met += u64::from(met.count());
        outcome.missed += u64::from(missed.count());
    }

    /// Adds those of other parts of a launch.
    pub(super) fn merge(&mut self, other: Self) {
        for (&(shader, op), outcome) in &other.0 {
            let own = self.0.entry((shader, op)).or_default();
            own.met += outcome.met;
            own.missed += outcome.missed;
        }
    }

    /// Adds a finding for each hint that is mostly wrong.
    pub(super) fn tell(&self, plans: &[ProgramPlan], levels: &Levels, findings: &mut Findings) {
        let rule = &arithmetic::EXPECT_WRONG;
        let level = levels.of(rule);
        if level == Level::Allow {
            return;
        }
        for (&(shader, op), outcome) in self.0.iter().filter(|(_, outcome)| outcome.is_wrong()) {
            let (shader, op) = (ShaderIndex(shader), OpIndex(op));
            let Some(plan) = plans.get(shader.index()) else { continue };
            let program = &*plan.program;
            let Outcome { met, missed, launch_id } = *outcome;
            let message = format!("the expected value came {met} times, and another {missed} times");
            let error = with_location(program, op, Error::new(ErrorKind::Finding, message), "");
            let (stage, name) = (program.stage.name(), &program.name);
            let first = program.describe_invocation(launch_id);
            let error = error.note(format!("in {stage} `{name}`, first in {first}"));
            let offset = program.origins.get(op.index()).map_or(0, |origin| origin.offset);
            let key = FindingKey { rule: rule.id, places: [(shader, offset), (shader, 0)] };
            let stack = vec![program.frame(shader, op)];
            findings.add(key, 1, Some(Finding { rule, level, count: 1, launch_id, stack, error }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Outcome;

    #[test]
    fn a_hint_is_wrong_where_most_of_enough_values_are_others() {
        let is_wrong = |met, missed| Outcome { met, missed, launch_id: [0; 3] }.is_wrong();
        assert!(is_wrong(1, 63) && is_wrong(0, 8) && is_wrong(31, 33));
        assert!(!is_wrong(32, 32) && !is_wrong(0, 1) && !is_wrong(60, 4));
    }
}
