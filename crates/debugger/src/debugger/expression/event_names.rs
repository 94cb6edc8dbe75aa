//! What an event of a traversal tells, by the names that a condition has for it.

use crate::debugger::expression::numbers::{CalculatedValue, ScalarType};
use anyhit_engine::accel::hit::{Candidate, HitPrimitive};
use anyhit_engine::geometry::Intersection;
use anyhit_engine::machine::{RayQueryEvent, RayQueryStep};
use anyhit_engine::pipeline::Event;

/// The values of an event, each with its own name and that of the builtin which it becomes.
#[derive(Clone, Debug, Default)]
pub struct EventNames {
    values: Vec<(&'static str, Option<&'static str>, CalculatedValue)>,
}

impl EventNames {
    /// What an event tells.
    pub(in crate::debugger) fn of(event: &Event) -> Self {
        let mut names = Self::default();
        match event {
            Event::Instance(instance, _) => names.add_index("instance", "InstanceId", *instance),
            Event::Primitive(hit, verdict)
            | Event::RayQuery(RayQueryEvent { step: RayQueryStep::Primitive(hit, verdict), .. }) => {
                names.add_primitive(*hit);
                if let Some(intersection) = verdict.intersection() {
                    let HitPrimitive { instance, geometry, primitive } = *hit;
                    let candidate = Candidate { instance, geometry, primitive, intersection, opaque: true };
                    names.add_intersection(&candidate);
                }
            }
            Event::Candidate { candidate, record, .. } => {
                let Candidate { instance, geometry, primitive, .. } = *candidate;
                names.add_primitive(HitPrimitive { instance, geometry, primitive });
                names.add_intersection(candidate);
                let record = CalculatedValue::scalar(ScalarType::Uint(64), record.0);
                names.values.push(("record", None, record));
            }
            _ => {}
        }
        names
    }

    fn add_index(&mut self, name: &'static str, builtin: &'static str, index: u32) {
        let value = CalculatedValue::scalar(ScalarType::Uint(32), index.into());
        self.values.push((name, Some(builtin), value));
    }

    fn add_primitive(&mut self, hit: HitPrimitive) {
        self.add_index("instance", "InstanceId", hit.instance);
        self.add_index("geometry", "RayGeometryIndexKHR", hit.geometry);
        self.add_index("primitive", "PrimitiveId", hit.primitive);
    }

    fn add_intersection(&mut self, candidate: &Candidate) {
        let float = |value: f32| CalculatedValue::scalar(ScalarType::Float(32), value.to_bits().into());
        let Intersection { t, attributes: [u, v], .. } = candidate.intersection;
        self.values.push(("t", Some("RayTmaxKHR"), float(t)));
        self.values.push(("u", None, float(u)));
        self.values.push(("v", None, float(v)));
        if let Some(kind) = candidate.hit_kind() {
            self.add_index("kind", "HitKindKHR", kind.0);
        }
    }

    /// The value of a name, or of the builtin of this name.
    pub(super) fn value(&self, name: &str) -> Option<CalculatedValue> {
        let is_it = |(own, builtin, _): &&(&str, Option<&str>, CalculatedValue)| {
            *own == name || *builtin == Some(name)
        };
        self.values.iter().find(is_it).map(|(.., value)| value.clone())
    }

    /// All names, in words.
    pub(super) fn names(&self) -> String {
        let names: Vec<&str> = self.values.iter().map(|(name, ..)| *name).collect();
        if names.is_empty() { "nothing".into() } else { names.join(", ") }
    }
}
