//! Compares the outputs of two runs value by value.

use std::collections::HashSet;

use crate::changed_scalars::changed_scalars;
use crate::expect::{Observed, ObservedMemory, RayFound};
use crate::stability::instability::UnstableOutput;
use crate::typed_scene::{declared, unbound_elements};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::Binding;
use anyhit_engine::machine::format::Class;
use anyhit_scene::Assembled;
use anyhit_unit_test::value::leaves::Leaf;

/// Compares the outputs of runs with those of a reference run.
#[derive(Debug)]
pub(crate) struct OutputComparison<'a> {
    assembled: &'a Assembled,
    reference: &'a Observed,
    tolerance: f64,
    found: SortedMap<String, Output>,
}

/// An output of which values differ, from one run at least.
#[derive(Debug)]
struct Output {
    /// The values that differ, by resource and place.
    values: HashSet<(usize, usize)>,
    /// The one that differs most.
    worst: UnstableOutput,
}

/// A resource or ray whose values are compared.
struct Subject<'n> {
    run: u32,
    /// Equal for values of one subject, and for these alone.
    number: usize,
    /// Empty for a ray.
    name: &'n str,
}

impl<'a> OutputComparison<'a> {
    /// Differences up to `tolerance` are none: of a value, or absolutely below 1.
    pub(crate) fn new(assembled: &'a Assembled, reference: &'a Observed, tolerance: f64) -> Self {
        Self { assembled, reference, tolerance, found: SortedMap::new() }
    }

    /// The number of outputs: resources that the reference run changed, and results of rays.
    pub(super) fn output_count(&self, before: &Observed) -> usize {
        let changed = |(one, other): &(&ObservedMemory, &ObservedMemory)| one.differs(other);
        let count =
            |one: &[ObservedMemory], other: &[ObservedMemory]| one.iter().zip(other).filter(changed).count();
        count(&self.reference.buffers, &before.buffers)
            + count(&self.reference.images, &before.images)
            + self.reference.rays.len()
    }

    /// Compares a run with the reference. What is equal byte by byte is not read value by value.
    pub(crate) fn add(&mut self, run: u32, other: &Observed) {
        let reference = self.reference;
        let buffers = reference.buffers.iter().zip(&other.buffers).enumerate();
        for (number, (one, other)) in buffers.filter(|(_, (one, other))| one.differs(other)) {
            self.compare_buffers(&Subject { run, number, name: &one.name }, one, other);
        }
        let images = reference.images.iter().zip(&other.images).enumerate();
        for (at, (one, other)) in images.filter(|(_, (one, other))| one.differs(other)) {
            let number = reference.buffers.len() + at;
            self.compare_images(&Subject { run, number, name: &one.name }, one, other);
        }
        let first = reference.buffers.len() + reference.images.len();
        for (at, (one, other)) in reference.rays.iter().zip(&other.rays).enumerate() {
            if let ((_, Ok(one)), (_, Ok(other))) = (one, other) {
                let subject = Subject { run, number: first + at, name: "" };
                for (place, (one, other)) in ray_leaves(one).into_iter().zip(ray_leaves(other)).enumerate() {
                    let ((path, one), (_, other)) = (one, other);
                    self.compare(&subject, place, [one, other], &|| output_name(&path), &|| path.clone());
                }
            }
        }
    }

    /// The outputs that differ.
    pub(crate) fn unstable(self) -> Vec<UnstableOutput> {
        let all = self.found.into_values();
        all.map(|output| UnstableOutput { values: output.values.len(), ..output.worst }).collect()
    }

    fn compare_buffers(&mut self, subject: &Subject<'_>, one: &ObservedMemory, other: &ObservedMemory) {
        let states = [one.bytes(), other.bytes()];
        let assembled = self.assembled;
        let compare = &mut |path: &str, offset: usize, values: [Leaf; 2]| {
            self.compare(subject, offset, values, &|| output_name(path), &|| path.to_owned());
        };
        let (layout, stride) = match one.binding {
            Some([set, binding, element]) => (declared(assembled, Binding { set, binding }, element), None),
            None => {
                let pointees = unbound_elements(assembled, &one.name);
                (pointees.map(|pointees| pointees.layout), pointees.and_then(|pointees| pointees.stride()))
            }
        };
        match layout {
            Some(layout) => changed_scalars(layout, stride, states, compare),
            None => {
                let bytes = states[0].iter().zip(states[1]).enumerate();
                for (at, (&one, &other)) in bytes.filter(|(_, (one, other))| one != other) {
                    compare(&format!("byte {at}"), at, [one, other].map(|byte| Leaf::Integer(byte.into())));
                }
            }
        }
    }

    fn compare_images(&mut self, subject: &Subject<'_>, one: &ObservedMemory, other: &ObservedMemory) {
        let Some((image, _)) = one.image() else { return };
        let format = image.format();
        let size = format.texel_size() as usize;
        let width = image.shape().extent[0] as usize;
        let numbers = |texel: &[u8]| {
            let mut bits = [0; 16];
            bits[..size].copy_from_slice(texel);
            format.decode_numbers(u128::from_le_bytes(bits))
        };
        let leaf = |number: f64| match format.class() {
            Class::Float => Leaf::Float(number),
            _ => Leaf::Integer(number as i128),
        };
        let texels = one.bytes().chunks_exact(size).zip(other.bytes().chunks_exact(size)).enumerate();
        for (at, (one, other)) in texels.filter(|(_, (one, other))| one != other) {
            let pairs = numbers(one).into_iter().zip(numbers(other));
            for (component, (one, other)) in pairs.enumerate() {
                let name = || {
                    let component = ["r", "g", "b", "a"].get(component).copied().unwrap_or("?");
                    format!("texel ({}, {}).{component}", at % width, at / width)
                };
                let values = [leaf(one), leaf(other)];
                // The components of a texel are one output.
                self.compare(subject, 4 * at + component, values, &|| "texel".into(), &name);
            }
        }
    }

    /// Compares two scalars; the names of the output and of the value are made where they differ.
    fn compare(
        &mut self,
        subject: &Subject<'_>,
        place: usize,
        values: [Leaf; 2],
        output: &dyn Fn() -> String,
        path: &dyn Fn() -> String,
    ) {
        let [one, other] = values;
        let Some(difference) = difference(one, other).filter(|&difference| difference > self.tolerance)
        else {
            return;
        };
        let key = format!("{} {}", subject.name, output());
        let output = self.found.entry(key).or_insert_with(|| Output {
            values: HashSet::new(),
            worst: UnstableOutput {
                name: String::new(),
                values: 0,
                reference: String::new(),
                other: String::new(),
                run: subject.run,
                difference: -1.0,
            },
        });
        output.values.insert((subject.number, place));
        if difference > output.worst.difference {
            let name = match subject.name {
                "" => path(),
                resource => format!("`{resource}` {}", path()),
            };
            let (reference, other) = (leaf_text(one), leaf_text(other));
            output.worst = UnstableOutput { name, values: 0, reference, other, run: subject.run, difference };
        }
    }
}

/// The hit and the payload of a ray, scalar by scalar.
fn ray_leaves(found: &RayFound) -> Vec<(String, Leaf)> {
    let hit = found.committed.map(|hit| hit.candidate.hit_primitive());
    let number = |number: Option<u32>| Leaf::Integer(number.map_or(-1, i128::from));
    let t = found.committed.map_or(f64::INFINITY, |hit| f64::from(hit.t));
    let mut leaves = vec![
        ("hit.instance".to_owned(), number(hit.map(|hit| hit.instance))),
        ("hit.geometry".to_owned(), number(hit.map(|hit| hit.geometry))),
        ("hit.primitive".to_owned(), number(hit.map(|hit| hit.primitive))),
        ("hit.t".to_owned(), Leaf::Float(t)),
    ];
    found.payload.scalars(&mut "payload".to_owned(), &mut |path, leaf| leaves.push((path.to_owned(), leaf)));
    leaves
}

/// The name of a value's output: its path without indices.
fn output_name(path: &str) -> String {
    let mut inside = false;
    let keep = |one: &char| {
        let was_inside = inside;
        inside = match one {
            '[' | '(' => true,
            ']' | ')' => false,
            _ => inside,
        };
        !inside && !was_inside && !one.is_ascii_digit()
    };
    path.chars().filter(keep).collect()
}

/// The difference of two scalars, relative above 1; `None` if they are equal.
fn difference(one: Leaf, other: Leaf) -> Option<f64> {
    match (one, other) {
        (Leaf::Float(one), Leaf::Float(other)) if one == other || (one.is_nan() && other.is_nan()) => None,
        (Leaf::Float(one), Leaf::Float(other)) if one.is_finite() && other.is_finite() => {
            Some((one - other).abs() / one.abs().max(1.0))
        }
        (Leaf::Integer(one), Leaf::Integer(other)) if one == other => None,
        _ => Some(f64::INFINITY),
    }
}

fn leaf_text(leaf: Leaf) -> String {
    match leaf {
        Leaf::Float(number) => format!("{}", number as f32),
        Leaf::Integer(number) => number.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_with_one_path_are_one_output() {
        assert_eq!(output_name("values[3].normal[0]"), "values.normal");
        assert_eq!(output_name("payload.t"), "payload.t");
    }

    #[test]
    fn floats_may_differ_a_little_and_integers_may_not() {
        assert_eq!(difference(Leaf::Float(4.0), Leaf::Float(3.0)), Some(0.25));
        assert_eq!(difference(Leaf::Float(0.5), Leaf::Float(0.25)), Some(0.25));
        assert_eq!(difference(Leaf::Float(f64::NAN), Leaf::Float(f64::NAN)), None);
        assert_eq!(difference(Leaf::Float(1.0), Leaf::Float(f64::NAN)), Some(f64::INFINITY));
        assert_eq!(difference(Leaf::Integer(7), Leaf::Integer(8)), Some(f64::INFINITY));
        assert_eq!(difference(Leaf::Integer(7), Leaf::Integer(7)), None);
    }
}
