//! `[expect.stats]`: how often shaders run, and what a ray may cost.

use crate::cost::Most;
use crate::expect::{Difference, Observed, Subject};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::Stats;
use anyhit_scene::read::{Parse, Span, Spanned, Table, TomlValue};

/// How often shaders run.
#[derive(Clone, Debug)]
pub struct StatsExpectation {
    /// Where its table begins.
    pub span: Span,
    /// Counts of the whole launch, each with its key and what counts it.
    pub totals: Vec<(&'static str, Total, Spanned<u64>)>,
    /// Invocations by stage.
    pub invocations: Vec<(Stage, Spanned<u64>)>,
    /// The most any-hit invocations that one ray may need.
    pub max_any_hit_per_ray: Option<Spanned<u64>>,
    /// The most SPIR-V instructions that the shaders of one ray may run.
    pub max_instructions_per_ray: Option<Spanned<u64>>,
    /// Why this is expected.
    pub because: Option<String>,
}

/// A count of the whole launch.
type Total = fn(&Stats) -> u64;

const TOTALS: [(&str, Total); 4] = [
    ("rays", |stats| stats.rays),
    ("ray_queries", |stats| stats.ray_queries),
    ("zero_directions", |stats| stats.zero_directions),
    ("reorders", |stats| stats.reorders),
];

const STAGES: [(&str, Stage); 7] = [
    ("ray_generation", Stage::RayGeneration),
    ("intersection", Stage::Intersection),
    ("any_hit", Stage::AnyHit),
    ("closest_hit", Stage::ClosestHit),
    ("miss", Stage::Miss),
    ("callable", Stage::Callable),
    ("compute", Stage::Compute),
];

impl Parse for StatsExpectation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let totals = TOTALS.map(|(key, total)| table.optional(key).map(|count| (key, total, count)));
        let counts = STAGES.map(|(key, stage)| table.optional(key).map(|count| (stage, count)));
        let max_any_hit_per_ray = table.optional("max_any_hit_per_ray");
        let max_instructions_per_ray = table.optional("max_instructions_per_ray");
        let because = table.optional("because");
        table.finish();
        Some(Self {
            span: value.span(),
            totals: totals.into_iter().flatten().collect(),
            invocations: counts.into_iter().flatten().collect(),
            max_any_hit_per_ray,
            max_instructions_per_ray,
            because,
        })
    }
}

impl StatsExpectation {
    pub(super) fn wants_costs(&self) -> bool {
        self.max_any_hit_per_ray.is_some() || self.max_instructions_per_ray.is_some()
    }

    pub(super) fn check(&self, observed: &Observed, differences: &mut Vec<Difference>) {
        let because = self.because.as_ref();
        if let Some(stats) = &observed.stats {
            let invocations = self.invocations.iter().map(|(stage, expected)| {
                let key = STAGES.iter().find(|(_, known)| known == stage).map_or("", |(key, _)| key);
                (key, expected, stats.invocations(*stage))
            });
            let totals = self.totals.iter().map(|(key, total, expected)| (*key, expected, total(stats)));
            for (key, expected, found) in totals.chain(invocations) {
                if expected.value != found {
                    let message = format!("{key}: expected {}, found {found}", expected.value);
                    differences.push(Difference::new(&expected.span, message, because).mended(
                        &expected.span,
                        found.to_string(),
                        because,
                    ));
                }
            }
        }
        let Some(costs) = &observed.costs else { return };
        let limits = [
            ("max_any_hit_per_ray", &self.max_any_hit_per_ray, &costs.any_hit, "any-hit invocations"),
            ("max_instructions_per_ray", &self.max_instructions_per_ray, &costs.instructions, "instructions"),
        ];
        for (key, limit, most, what) in limits {
            let (Some(limit), Some(most)) = (limit, most) else { continue };
            if most.count > limit.value {
                differences.push(exceeded(key, limit, most, what, because));
            }
        }
    }
}

fn exceeded(
    key: &str,
    limit: &Spanned<u64>,
    most: &Most,
    what: &str,
    because: Option<&String>,
) -> Difference {
    let message = format!("{key}: a ray needs {} {what} (allowed: {})", most.count, limit.value);
    let mut difference =
        Difference::new(&limit.span, message, because).mended(&limit.span, most.count.to_string(), because);
    if let Some([x, y, z]) = most.launch_id {
        let note = format!("ray {} of launch id ({x}, {y}, {z})", most.ray);
        difference.error = difference.error.note(note);
        difference = difference.about(Subject::Invocation([x, y, z]));
    }
    difference
}
