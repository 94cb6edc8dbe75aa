//! Compares the outputs of two runs value by value.

use std::collections::HashSet;

use crate::harness::expect::{Bytes, Observed};
use crate::harness::stability::instability::UnstableOutput;
use crate::harness::typed_scene::{typed, typed_unbound};
use crate::harness::value::leaves::Leaf;
use crate::machine::Binding;
use crate::machine::format::Class;
use crate::scene::Assembled;
use crate::sorted::SortedMap;

/// Compares the outputs of runs with those of a reference run.
#[derive(Debug)]
pub(in crate::harness) struct OutputComparison<'a> {
    assembled: &'a Assembled,
    reference: &'a Observed,
    tolerance: f64,
    /// By output: the values that differ, and the one that differs most.
    found: SortedMap<String, (HashSet<String>, UnstableOutput)>,
}

impl<'a> OutputComparison<'a> {
    /// Differences up to `tolerance` are none: of a value, or absolutely below 1.
    pub(in crate::harness) fn new(assembled: &'a Assembled, reference: &'a Observed, tolerance: f64) -> Self {
        Self { assembled, reference, tolerance, found: SortedMap::new() }
    }

    /// The number of outputs: resources that the reference run changed, and results of rays.
    pub(super) fn output_count(&self, before: &Observed) -> usize {
        let changed = |(one, other): &(&Bytes, &Bytes)| one.bytes != other.bytes;
        let count = |one: &[Bytes], other: &[Bytes]| one.iter().zip(other).filter(changed).count();
        count(&self.reference.buffers, &before.buffers)
            + count(&self.reference.images, &before.images)
            + self.reference.rays.len()
    }

    /// Compares a run with the reference.
    pub(in crate::harness) fn add(&mut self, run: u32, other: &Observed) {
        let reference = self.reference;
        for (one, other) in reference.buffers.iter().zip(&other.buffers) {
            if one.bytes != other.bytes {
                self.compare_values(run, &one.name, &self.buffer(one), &self.buffer(other));
            }
        }
        for (one, other) in reference.images.iter().zip(&other.images) {
            if one.bytes != other.bytes {
                self.compare_values(run, &one.name, &texels(one), &texels(other));
            }
        }
        for (one, other) in reference.rays.iter().zip(&other.rays) {
            if let ((_, Ok(one)), (_, Ok(other))) = (one, other) {
                let leaves = |found: &crate::harness::expect::RayFound| {
                    let mut leaves = Vec::new();
                    let hit = found.committed.map(|hit| hit.candidate.hit_primitive());
                    let number = |number: Option<u32>| number.map_or(-1, i128::from);
                    let numbers = [
                        ("instance", hit.map(|hit| hit.instance)),
                        ("geometry", hit.map(|hit| hit.geometry)),
                        ("primitive", hit.map(|hit| hit.primitive)),
                    ];
                    leaves.extend(
                        numbers.map(|(name, value)| (format!("hit.{name}"), Leaf::Integer(number(value)))),
                    );
                    let t = found.committed.map_or(f64::INFINITY, |hit| f64::from(hit.t));
                    leaves.push(("hit.t".to_owned(), Leaf::Float(t)));
                    found.payload.scalars(&mut "payload".to_owned(), &mut |path, leaf| {
                        leaves.push((path.to_owned(), leaf));
                    });
                    leaves
                };
                self.compare_values(run, "", &leaves(one), &leaves(other));
            }
        }
    }

    /// The outputs that differ.
    pub(in crate::harness) fn unstable(self) -> Vec<UnstableOutput> {
        let all = self.found.into_values();
        all.map(|(values, worst)| UnstableOutput { values: values.len(), ..worst }).collect()
    }

    fn compare_values(&mut self, run: u32, resource: &str, one: &[(String, Leaf)], other: &[(String, Leaf)]) {
        for ((path, one), (_, other)) in one.iter().zip(other) {
            let Some(difference) = difference(*one, *other).filter(|&difference| difference > self.tolerance)
            else {
                continue;
            };
            let name = match resource {
                "" => path.clone(),
                resource => format!("`{resource}` {path}"),
            };
            let worst = UnstableOutput {
                name: name.clone(),
                values: 0,
                reference: leaf_text(*one),
                other: leaf_text(*other),
                run,
                difference,
            };
            let (values, known) =
                self.found.entry(format!("{resource} {}", output_name(path))).or_insert_with(|| {
                    let none = UnstableOutput { difference: -1.0, ..worst.clone() };
                    (HashSet::new(), none)
                });
            values.insert(name);
            if difference > known.difference {
                *known = worst;
            }
        }
    }

    fn buffer(&self, bytes: &Bytes) -> Vec<(String, Leaf)> {
        let mut leaves = Vec::new();
        let value = match bytes.binding {
            Some([set, binding, _]) => typed(self.assembled, Binding { set, binding }, &bytes.bytes),
            None => typed_unbound(self.assembled, &bytes.name, &bytes.bytes),
        };
        match value {
            Some(value) => value.scalars(&mut String::new(), &mut |path, leaf| {
                leaves.push((path.to_owned(), leaf));
            }),
            None => leaves.extend(
                bytes
                    .bytes
                    .iter()
                    .enumerate()
                    .map(|(at, &byte)| (format!("byte {at}"), Leaf::Integer(byte.into()))),
            ),
        }
        leaves
    }
}

/// The components of an image's texels.
fn texels(bytes: &Bytes) -> Vec<(String, Leaf)> {
    let Some((image, _)) = &bytes.image else { return Vec::new() };
    let format = image.format();
    let size = format.texel_size() as usize;
    let width = image.shape().extent[0] as usize;
    let texels = bytes.bytes.chunks_exact(size).enumerate().flat_map(|(at, texel)| {
        let mut bits = [0; 16];
        bits[..size].copy_from_slice(texel);
        let numbers = format.decode_numbers(u128::from_le_bytes(bits));
        let (x, y) = (at % width, at / width);
        numbers.into_iter().zip(["r", "g", "b", "a"]).map(move |(number, component)| {
            let leaf = match format.class() {
                Class::Float => Leaf::Float(number),
                _ => Leaf::Integer(number as i128),
            };
            (format!("texel ({x}, {y}).{component}"), leaf)
        })
    });
    texels.collect()
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
    let name: String = path.chars().filter(keep).collect();
    // The components of a texel are one output.
    if name.starts_with("texel") { "texel".into() } else { name }
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
        assert_eq!(output_name("texel (3, 4).g"), "texel");
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
