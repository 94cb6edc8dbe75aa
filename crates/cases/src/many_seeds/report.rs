//! What is told of a difference.

use std::collections::BTreeMap;

use crate::many_seeds::runs::{Drawing, RunDifference, Runs};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind};
use anyhit_engine::accel::Candidate;
use anyhit_engine::machine::{ChoiceKind, ChoiceSite, DrawnDetails, DrawnTraversal, OpIndex, ShaderIndex};
use anyhit_engine::ops::op::Op;
use anyhit_engine::pipeline::with_location;
use anyhit_engine::program::Program;
use anyhit_sanitize::Finding;
use anyhit_sanitize::rule::{Level, Rule};
use anyhit_sanitize::structures::primitive_name;
use anyhit_scene::ResolvedScene;

/// The most hits of a ray that are told.
const TOLD_HITS: usize = 6;

/// What a finding is made of.
pub(super) struct DifferenceReport<'a> {
    pub scene: &'a ResolvedScene,
    pub runs: &'a Runs<'a>,
    /// The command that repeats the runs, but for its seeds.
    pub command: Option<&'a str>,
    /// The choice that is told, the first of those that are drawn.
    pub kind: ChoiceKind,
    /// What was drawn in the run that is told of.
    pub drawing: &'a Drawing,
    /// What was drawn there, where it makes a difference to this crate's own choice.
    pub draws: &'a BTreeMap<ChoiceSite, Option<DrawnDetails>>,
    pub difference: &'a RunDifference,
    /// Whether it suffices that invocations run one after the other, not side by side.
    pub is_one_by_one: bool,
}

impl DifferenceReport<'_> {
    /// The finding.
    pub(super) fn finding(&self, rule: &'static Rule, level: Level) -> Finding {
        let first = self.draws.iter().next();
        let kind = self.kind;
        let launch_id = first.map_or([0; 3], |(site, _)| site.launch_id);
        let message = match self.difference {
            RunDifference::Value { name, own, drawn } => {
                format!("{name} is {own}, and {drawn} where {}", where_drawn(kind))
            }
            RunDifference::Trap(trap) => {
                format!("the run ends with a trap where {}: {}", where_drawn(kind), trap.message())
            }
        };
        let mut error = Error::new(ErrorKind::Finding, message);
        error = match first {
            Some((site, Some(DrawnDetails::Traversal(drawn)))) => self.describe_ray(error, site, drawn),
            Some((site, Some(DrawnDetails::Value { shader, op, what }))) => {
                self.describe_value(error, site, *shader, *op, what.as_deref())
            }
            Some((site, Some(DrawnDetails::Order { part, unit, pair }))) => {
                let [first, second] =
                    pair.map(|number| self.runs.name_of_unit(site.pass, *part, *unit, number));
                error.note(format!("the difference is caused by {first} running before {second}"))
            }
            _ if self.is_one_by_one => error.note(
                "the difference occurs whenever invocations run one after another instead of \
                    side by side",
            ),
            _ => error,
        };
        error = self.drawing.kinds.iter().skip(1).fold(error, |error, &other| {
            error.note(format!(
                "the difference requires several choices together; also: {}",
                where_drawn(other)
            ))
        });
        if self.draws.len() > 1 {
            error = error.note(format!(
                "{} draws together cause the difference; the first is shown",
                grouped(self.draws.len())
            ));
        }
        let (seed, command) = (self.drawing.seed, self.command);
        let drawn = |is_drawn: fn(ChoiceKind) -> bool| self.drawing.kinds.iter().any(|&kind| is_drawn(kind));
        let more = match () {
            () if drawn(ChoiceKind::is_of_fast_math) => " --fast-math",
            () if drawn(ChoiceKind::is_contracted) => " --contract",
            () => "",
        };
        error = error.note(match command {
            Some(command) => {
                format!("drawn by seed {seed}: {command} --seed-range {seed}..{}{more}", seed + 1)
            }
            None => format!("drawn by seed {seed}"),
        });
        Finding { rule, level, count: 0, launch_id, stack: Vec::new(), error }
    }

    /// Adds where a ray is traced, what it is, and its hits in both orders.
    fn describe_ray(&self, error: Error, site: &ChoiceSite, drawn: &DrawnTraversal) -> Error {
        let program = drawn.caller.and_then(|(shader, op)| Some((self.runs.program(*site, shader)?, op)));
        let error = match program {
            Some((program, op)) => {
                let error = with_location(&program, op, error, "the ray is traced here");
                let module = drawn.caller.and_then(|(shader, _)| self.runs.module_file(site, shader));
                module.into_iter().fold(invocation(error, &program, site), Error::in_module)
            }
            None => error,
        };
        let triple = |[x, y, z]: [f32; 3]| format!("({x}, {y}, {z})");
        let ray = &drawn.ray.ray;
        let error = error.note(format!("the ray {} + t {}", triple(ray.origin), triple(ray.direction)));
        error
            .note(format!("its hits in anyhit's order: {}", self.hits(drawn, &drawn.own)))
            .note(format!("as drawn: {}", self.hits(drawn, &drawn.hits)))
    }

    /// The names of hits, with their t.
    fn hits(&self, drawn: &DrawnTraversal, hits: &[Candidate]) -> String {
        let name = |hit: &Candidate| {
            let name = primitive_name(self.scene, &drawn.tlas, hit.hit_primitive());
            format!("{name} (t {})", hit.intersection.t)
        };
        let mut names: Vec<String> = hits.iter().take(TOLD_HITS).map(name).collect();
        if hits.len() > TOLD_HITS {
            names.push(format!("and {} more", grouped(hits.len() - TOLD_HITS)));
        }
        names.join("; ")
    }

    /// Adds which value of a shader is drawn.
    fn describe_value(
        &self,
        error: Error,
        site: &ChoiceSite,
        shader: ShaderIndex,
        op: Option<OpIndex>,
        what: Option<&str>,
    ) -> Error {
        let Some(program) = self.runs.program(*site, shader) else { return error };
        let error = self.runs.module_file(site, shader).into_iter().fold(error, Error::in_module);
        let (stage, name) = (program.stage.name(), &program.name);
        let label = |op: OpIndex| label(site.kind, program.ops.get(op.index()));
        let error = op.into_iter().fold(error, |error, op| with_location(&program, op, error, label(op)));
        let error = what.into_iter().fold(error, |error, what| error.note(what));
        if site.kind.is_contracted() || site.kind.is_of_fast_math() {
            return error.note(format!("in {stage} `{name}`"));
        }
        invocation(error, &program, site)
    }
}

/// What happens at the operation where a value is drawn.
fn label(kind: ChoiceKind, op: Option<&Op>) -> &'static str {
    match kind {
        ChoiceKind::RobustRead => "it reads outside its buffer here",
        ChoiceKind::RobustTexel => "it reads outside its image here",
        ChoiceKind::UndefinedResult => "the result is undefined here",
        ChoiceKind::Contraction => "its product is not rounded here",
        ChoiceKind::DotOrder => "its products are summed in another order here",
        ChoiceKind::Reassociation => "its operands are reordered here",
        ChoiceKind::Division => "its quotient is rounded differently here",
        ChoiceKind::FunctionPrecision => "it is less accurate here",
        ChoiceKind::ZeroSign => "its zeros have another sign here",
        ChoiceKind::DenormalFlush => "its denormal numbers are flushed here",
        _ if op.is_some_and(|op| op.undefines().is_some()) => "it is undefined from here on",
        _ => "it is read here",
    }
}

/// Adds the invocation in which something is drawn.
fn invocation(error: Error, program: &Program, site: &ChoiceSite) -> Error {
    let (stage, name) = (program.stage.name(), &program.name);
    error.note(format!("in {stage} `{name}`, {}", program.describe_invocation(site.launch_id)))
}

/// What is different with a choice.
fn where_drawn(kind: ChoiceKind) -> &'static str {
    match kind {
        ChoiceKind::AnyHitOrder => "the hits of a ray come in another order",
        ChoiceKind::AnyHitDuplicate => "a hit of a ray comes twice",
        ChoiceKind::IntersectionRepeat => "the intersection shader of a box runs twice, or beside the box",
        ChoiceKind::TieOrder => "another of the hits at equal t is the closest",
        ChoiceKind::InvocationOrder => "invocations run in another order",
        ChoiceKind::SubgroupComposition => "other invocations form a subgroup",
        ChoiceKind::SubgroupSize => "subgroups have another size",
        ChoiceKind::RobustRead => "a read outside its buffer gives another value",
        ChoiceKind::UndefinedValue => "an undefined value is another one",
        ChoiceKind::UndefinedResult => "an undefined result is another one",
        ChoiceKind::WorkgroupMemory => "workgroup memory holds something else at the beginning",
        ChoiceKind::RobustTexel => "a read outside its image gives another texel",
        ChoiceKind::Contraction => "a product is added without being rounded",
        ChoiceKind::DotOrder => "a dot product is added up in another way",
        ChoiceKind::Reassociation => "a sum or product is calculated in another order",
        ChoiceKind::Division => "a quotient is rounded otherwise",
        ChoiceKind::FunctionPrecision => "a function is less exact",
        ChoiceKind::ZeroSign => "a zero has the other sign",
        ChoiceKind::DenormalFlush => "denormal numbers are flushed to zero",
    }
}
