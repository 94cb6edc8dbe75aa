//! Choices that the specification leaves open, drawn at random: in what order any-hit shaders run,
//! which of two hits at equal t is the closest, what an undefined variable holds.
//!
//! Each draw belongs to a [`ChoiceSite`], and depends on nothing but the seed and that site: not on
//! threads, not on the batch's width, and not on other draws. So a single one can be left out.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use crate::accel::{Candidate, Cursor, Tlas, TraceRay, TraversalSeeds};
use crate::geometry::Ray;
use crate::machine::index::{OpIndex, ShaderIndex};
use crate::math::array;
use crate::math::permutation::{OrderLimit, Permutation};
use crate::math::random::Random;

/// The most draws that a log keeps; each takes some 60 bytes.
const MOST_DRAWS: usize = 1 << 22;

/// A choice that the specification leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ChoiceKind {
    /// In which order the candidates of a ray are decided on.
    AnyHitOrder,
    /// For which candidates an any-hit shader runs a second time.
    AnyHitDuplicate,
    /// For which boxes an intersection shader runs a second time.
    IntersectionRepeat,
    /// Which of several hits at equal t is the closest.
    TieOrder,
    /// In which order invocations, subgroups or workgroups run.
    InvocationOrder,
    /// Which invocations form a subgroup, and which lane each of them has.
    SubgroupComposition,
    /// How many invocations form a subgroup.
    SubgroupSize,
    /// What a robust read outside its buffer gives.
    RobustRead,
    /// What an undefined value is.
    UndefinedValue,
    /// What an operation gives whose operands leave its result undefined.
    UndefinedResult,
    /// What the memory of a workgroup holds before it is written.
    WorkgroupMemory,
    /// What a robust read outside its image gives.
    RobustTexel,
    /// Whether a sum takes a product that is not rounded.
    Contraction,
    /// In which order a dot or matrix product adds its products, and which of them are rounded.
    DotOrder,
    /// In which order the terms of a sum are added, or the factors of a product multiplied.
    Reassociation,
    /// How a quotient is rounded.
    Division,
    /// How exact an elementary function is.
    FunctionPrecision,
    /// Which sign a zero has.
    ZeroSign,
    /// Whether a denormal number is flushed to zero.
    DenormalFlush,
}

impl ChoiceKind {
    /// All choices.
    pub const ALL: [Self; 19] = [
        Self::AnyHitOrder,
        Self::AnyHitDuplicate,
        Self::IntersectionRepeat,
        Self::TieOrder,
        Self::InvocationOrder,
        Self::SubgroupComposition,
        Self::SubgroupSize,
        Self::RobustRead,
        Self::UndefinedValue,
        Self::UndefinedResult,
        Self::WorkgroupMemory,
        Self::RobustTexel,
        Self::Contraction,
        Self::DotOrder,
        Self::Reassociation,
        Self::Division,
        Self::FunctionPrecision,
        Self::ZeroSign,
        Self::DenormalFlush,
    ];

    /// Whether an observer of shaders draws it: it is about values in registers, or about memory
    /// that shaders alone see.
    pub fn is_of_values(self) -> bool {
        let is_undefined = matches!(
            self,
            Self::UndefinedValue | Self::UndefinedResult | Self::WorkgroupMemory | Self::RobustTexel
        );
        is_undefined || self.is_contracted() || self.is_of_fast_math()
    }

    /// Whether it is about sums of products that are rounded once.
    pub fn is_contracted(self) -> bool {
        matches!(self, Self::Contraction | Self::DotOrder)
    }

    /// Whether it is about how floats are calculated with, other than sums of products.
    pub fn is_of_fast_math(self) -> bool {
        matches!(
            self,
            Self::Reassociation
                | Self::Division
                | Self::FunctionPrecision
                | Self::ZeroSign
                | Self::DenormalFlush
        )
    }
}

/// Where a choice is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChoiceSite {
    /// The choice.
    pub kind: ChoiceKind,
    /// The number of the pass.
    pub pass: u32,
    /// `LaunchIdKHR`, in compute shaders `GlobalInvocationId`, of the invocation.
    pub launch_id: [u32; 3],
    /// What tells the draws of an invocation apart: a hash of the ray, or the variable.
    pub place: u64,
}

/// What was drawn at a site.
#[derive(Clone, Debug)]
pub enum DrawnDetails {
    /// The hits of a ray.
    Traversal(DrawnTraversal),
    /// A value of a shader.
    Value {
        /// The shader.
        shader: ShaderIndex,
        /// The operation that leaves it open; `None` for what is open when the shader begins.
        op: Option<OpIndex>,
        /// What is drawn there, in words, where there is more to tell than the operation.
        what: Option<String>,
    },
    /// Which of two units of an order comes first: the first one, which it does not in this crate's
    /// order.
    Order {
        /// What is in an order.
        part: OrderPart,
        /// How many of them move together.
        unit: u64,
        /// The numbers of the first ones of both.
        pair: [u64; 2],
    },
}

/// What of a pass is in an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrderPart {
    /// The invocations of a launch, or the workgroups of a dispatch.
    Grid,
    /// The invocations of each workgroup.
    Workgroup,
}

/// How much of the orders that are drawn is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OrderLimits {
    /// Of the invocations of a launch, or the workgroups of a dispatch.
    pub grid: OrderLimit,
    /// Of the invocations of each workgroup.
    pub workgroup: OrderLimit,
}

/// What was drawn of a traversal.
#[derive(Clone, Debug)]
pub struct DrawnTraversal {
    /// The ray.
    pub ray: TraceRay,
    /// The acceleration structure.
    pub tlas: Arc<Tlas>,
    /// The instruction that traces, where it is known: its shader and operation.
    pub caller: Option<(ShaderIndex, OpIndex)>,
    /// The hits in this crate's order.
    pub own: Vec<Candidate>,
    /// The hits in the order that was drawn.
    pub hits: Vec<Candidate>,
}

/// The draws of a run that make a difference to what this crate chooses.
#[derive(Debug, Default)]
pub struct ChoiceLog {
    /// Whether it is kept what each draw did.
    keeps_details: bool,
    draws: Mutex<BTreeMap<ChoiceSite, Option<DrawnDetails>>>,
}

impl ChoiceLog {
    /// A log of the sites, and if wanted of what was drawn there.
    pub fn new(keeps_details: bool) -> Arc<Self> {
        Arc::new(Self { keeps_details, ..Self::default() })
    }

    /// The draws so far; the log is empty afterwards.
    pub fn take(&self) -> BTreeMap<ChoiceSite, Option<DrawnDetails>> {
        std::mem::take(&mut self.draws.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn add(&self, site: ChoiceSite, details: Option<impl FnOnce() -> DrawnDetails>) {
        let details = details.filter(|_| self.keeps_details).map(|details| details());
        let mut draws = self.draws.lock().unwrap_or_else(PoisonError::into_inner);
        if draws.len() < MOST_DRAWS {
            let known = draws.entry(site).or_default();
            *known = details.or(known.take());
        }
    }
}

/// Which choices are drawn in a pass, and from which seed.
#[derive(Clone, Debug)]
pub struct OpenChoices {
    /// The seed.
    pub seed: u64,
    /// The number of the pass.
    pub pass: u32,
    /// The shader that they are for.
    pub shader: ShaderIndex,
    /// The choices that are drawn.
    pub kinds: BTreeSet<ChoiceKind>,
    /// Where they are drawn; `None` for everywhere.
    pub only: Option<Arc<BTreeSet<ChoiceSite>>>,
    /// How much of the orders that are drawn is kept; `None` for all.
    pub orders: Option<OrderLimits>,
    /// Where it is noted what was drawn.
    pub log: Option<Arc<ChoiceLog>>,
}

impl OpenChoices {
    /// These choices for another shader of the pass.
    #[must_use]
    pub fn in_shader(&self, shader: ShaderIndex) -> Self {
        Self { shader, ..self.clone() }
    }

    /// The site of a choice in this pass.
    pub fn site(&self, kind: ChoiceKind, launch_id: [u32; 3], place: u64) -> ChoiceSite {
        ChoiceSite { kind, pass: self.pass, launch_id, place }
    }

    /// The random numbers of a site; `None` where this crate's own choice holds.
    pub fn draw(&self, site: ChoiceSite) -> Option<Random> {
        let is_drawn =
            self.kinds.contains(&site.kind) && self.only.as_ref().is_none_or(|only| only.contains(&site));
        let [x, y, z] = array::map(site.launch_id, u64::from);
        let numbers = [site.kind as u64, site.pass.into(), x, y, z, site.place];
        is_drawn.then(|| Random::of(self.seed, numbers))
    }

    /// Draws a choice about a whole pass, and notes that it makes a difference; `None` where this
    /// crate's own choice holds.
    pub fn draw_of_pass(&self, kind: ChoiceKind) -> Option<Random> {
        let site = self.site(kind, [0; 3], 0);
        let drawn = self.draw(site)?;
        if let Some(log) = &self.log {
            log.add(site, None::<fn() -> DrawnDetails>);
        }
        Some(drawn)
    }

    /// Draws the order of so many invocations or workgroups, in units that move together; `None`
    /// where this crate's own order holds.
    pub fn draw_order(
        &self,
        kind: ChoiceKind,
        part: OrderPart,
        count: u64,
        unit: u64,
    ) -> Option<Permutation> {
        let drawn = Permutation::draw(count, unit, &mut self.draw_of_pass(kind)?);
        let Some(limits) = &self.orders else { return Some(drawn) };
        let limit = match part {
            OrderPart::Grid => limits.grid,
            OrderPart::Workgroup => limits.workgroup,
        };
        let (order, pair) = drawn.limited(limit);
        if let Some(pair) = pair {
            let pair = array::map(pair, |number| number * unit);
            self.note(self.site(kind, [0; 3], 0), || DrawnDetails::Order { part, unit, pair });
        }
        Some(order)
    }

    /// Whether invocations that see each other's memory run one after the other, not side by side.
    pub fn runs_one_by_one(&self) -> bool {
        self.draw_of_pass(ChoiceKind::InvocationOrder).is_some_and(|mut random| random.bits() & 1 == 0)
    }

    /// Notes a draw that makes a difference, with what was drawn.
    pub fn note(&self, site: ChoiceSite, details: impl FnOnce() -> DrawnDetails) {
        if let Some(log) = &self.log {
            log.add(site, Some(details));
        }
    }

    /// Whether anything is drawn about traversals.
    pub fn draws_traversals(&self) -> bool {
        use ChoiceKind::{AnyHitDuplicate, AnyHitOrder, IntersectionRepeat, TieOrder};
        let kinds = [AnyHitOrder, AnyHitDuplicate, IntersectionRepeat, TieOrder];
        kinds.iter().any(|kind| self.kinds.contains(kind))
    }

    /// Draws what an operation reads outside its buffer; `None` where it reads 0.
    #[cold]
    pub fn draw_robust_read(&self, launch_id: [u32; 3], op: OpIndex, offset: u64) -> Option<u64> {
        let place = Random::of(0, [self.shader.0.into(), op.index() as u64, offset]).bits();
        let site = self.site(ChoiceKind::RobustRead, launch_id, place);
        let seed = self.draw(site)?.bits();
        self.note(site, || DrawnDetails::Value { shader: self.shader, op: Some(op), what: None });
        Some(seed)
    }

    /// Draws what is open about a traversal that has not begun yet, of a ray that an operation of
    /// this shader traces; `None` for a ray from the host.
    pub fn draw_traversal(
        &self,
        launch_id: [u32; 3],
        op: Option<OpIndex>,
        tlas: &Arc<Tlas>,
        cursor: &mut Cursor,
    ) {
        let ray = *cursor.trace();
        let place = place_of_ray(&ray, self.shader, op);
        let site = |kind| self.site(kind, launch_id, place);
        let seed = |kind| Some(self.draw(site(kind))?.bits());
        let seeds = TraversalSeeds {
            any_hit_order: seed(ChoiceKind::AnyHitOrder),
            any_hit_duplicates: seed(ChoiceKind::AnyHitDuplicate),
            intersection_repeats: seed(ChoiceKind::IntersectionRepeat),
            ties: seed(ChoiceKind::TieOrder),
        };
        if seeds == TraversalSeeds::default() {
            return;
        }
        let effective = cursor.draw(tlas, seeds);
        for (kind, seed) in [
            (ChoiceKind::AnyHitOrder, effective.any_hit_order),
            (ChoiceKind::AnyHitDuplicate, effective.any_hit_duplicates),
            (ChoiceKind::IntersectionRepeat, effective.intersection_repeats),
            (ChoiceKind::TieOrder, effective.ties),
        ] {
            if seed.is_some() {
                self.note(site(kind), || {
                    let caller = op.map(|op| (self.shader, op));
                    let own = cursor.all_hits(tlas);
                    let hits = cursor.drawn_hits().copied().collect();
                    DrawnDetails::Traversal(DrawnTraversal { ray, tlas: tlas.clone(), caller, own, hits })
                });
            }
        }
    }
}

/// What tells rays of an invocation apart: their operands, and the instruction that traces.
fn place_of_ray(ray: &TraceRay, shader: ShaderIndex, op: Option<OpIndex>) -> u64 {
    let op = op.map_or(0, |op| op.index() as u64 + 1);
    let Ray { origin, direction, t_min, t_max } = ray.ray;
    let floats = origin.into_iter().chain(direction).chain([t_min, t_max, ray.time]);
    let numbers = floats.map(|number| number.to_bits().into());
    let others = [shader.0.into(), op, ray.flags.0.into(), ray.cull_mask.into()];
    Random::of(0, numbers.chain(others)).bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choices(seed: u64, kinds: &[ChoiceKind]) -> OpenChoices {
        let kinds = kinds.iter().copied().collect();
        OpenChoices { seed, pass: 0, shader: ShaderIndex(0), kinds, only: None, orders: None, log: None }
    }

    #[test]
    fn a_draw_depends_on_its_seed_and_site_alone() {
        let all = choices(1, &ChoiceKind::ALL);
        let one = choices(1, &[ChoiceKind::TieOrder]);
        let bits = |choices: &OpenChoices, site| choices.draw(site).map(|mut random| random.bits());
        let site = all.site(ChoiceKind::TieOrder, [3, 1, 0], 7);
        let drawn = bits(&all, site);
        assert!(drawn.is_some());
        assert_eq!(bits(&one, site), drawn);
        assert_ne!(bits(&choices(2, &ChoiceKind::ALL), site), drawn);
        for other in [
            ChoiceSite { launch_id: [1, 3, 0], ..site },
            ChoiceSite { place: 8, ..site },
            ChoiceSite { pass: 1, ..site },
            ChoiceSite { kind: ChoiceKind::AnyHitOrder, ..site },
        ] {
            assert_ne!(bits(&all, other), drawn, "{other:?}");
        }
    }

    #[test]
    fn what_is_not_asked_for_is_not_drawn() {
        let one = choices(1, &[ChoiceKind::TieOrder]);
        let site = one.site(ChoiceKind::TieOrder, [0; 3], 0);
        assert!(one.draw(ChoiceSite { kind: ChoiceKind::AnyHitOrder, ..site }).is_none());
        let elsewhere = ChoiceSite { place: 1, ..site };
        let only = OpenChoices { only: Some(Arc::new([site].into())), ..one };
        assert!(only.draw(site).is_some() && only.draw(elsewhere).is_none());
    }

    #[test]
    fn a_log_keeps_what_it_is_asked_for() {
        for keeps_details in [false, true] {
            let log = ChoiceLog::new(keeps_details);
            let one = OpenChoices { log: Some(log.clone()), ..choices(1, &[ChoiceKind::RobustRead]) };
            assert!(one.draw_robust_read([1, 0, 0], OpIndex(5), 64).is_some());
            let draws = log.take();
            let details: Vec<bool> = draws.values().map(Option::is_some).collect();
            assert_eq!(details, [keeps_details]);
            assert!(log.take().is_empty());
        }
    }
}
