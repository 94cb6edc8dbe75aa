//! What a run leaves behind, compared with another run value by value.

use std::collections::{BTreeMap, HashSet};

use crate::harness::expect::{Bytes, Observed};
use crate::harness::typed::typed;
use crate::harness::value::Leaf;
use crate::machine::Binding;
use crate::machine::format::Class;
use crate::scene::Assembled;

/// An output that is not the same in every run.
#[derive(Clone, Debug, PartialEq)]
pub struct Unstable {
    /// The value that differs most: `` `sums` values[3] ``, `` `image` texel (4, 2).r ``,
    /// `payload.color[0]`.
    pub name: String,
    /// How many values of the output differ in some run.
    pub values: usize,
    /// The value without perturbation.
    pub reference: String,
    /// The value that differs most from it.
    pub other: String,
    /// The run of that one, from 1.
    pub run: u32,
    /// By how much, as a share of the value or absolutely below 1; infinite for what is no float.
    pub spread: f64,
}

/// Finds what differs.
#[derive(Debug)]
pub(super) struct Comparison<'a> {
    assembled: &'a Assembled,
    reference: &'a Observed,
    tolerance: f64,
    /// By output: the values that differ, and the worst.
    found: BTreeMap<String, (HashSet<String>, Unstable)>,
}

impl<'a> Comparison<'a> {
    /// Differences up to `tolerance` are none: of a value, or absolutely below 1.
    pub fn new(assembled: &'a Assembled, reference: &'a Observed, tolerance: f64) -> Self {
        Self { assembled, reference, tolerance, found: BTreeMap::new() }
    }

    /// How many outputs there are: resources that the reference has changed, and the ray's.
    pub fn outputs(&self, before: &Observed) -> usize {
        let changed = |(one, other): &(&Bytes, &Bytes)| one.bytes != other.bytes;
        let count = |one: &[Bytes], other: &[Bytes]| one.iter().zip(other).filter(changed).count();
        count(&self.reference.buffers, &before.buffers)
            + count(&self.reference.images, &before.images)
            + self.reference.rays.len()
    }

    /// Compares a run.
    pub fn add(&mut self, run: u32, other: &Observed) {
        let reference = self.reference;
        for (one, other) in reference.buffers.iter().zip(&other.buffers) {
            if one.bytes != other.bytes {
                self.all(run, &one.name, &self.buffer(one), &self.buffer(other));
            }
        }
        for (one, other) in reference.images.iter().zip(&other.images) {
            if one.bytes != other.bytes {
                self.all(run, &one.name, &texels(one), &texels(other));
            }
        }
        for (one, other) in reference.rays.iter().zip(&other.rays) {
            if let ((_, Ok(one)), (_, Ok(other))) = (one, other) {
                let leaves = |found: &crate::harness::expect::RayFound| {
                    let mut leaves = Vec::new();
                    let place = found.committed.map(|hit| hit.candidate.hit_primitive());
                    let number = |number: Option<u32>| number.map_or(-1, i128::from);
                    let numbers = [
                        ("instance", place.map(|place| place.instance)),
                        ("geometry", place.map(|place| place.geometry)),
                        ("primitive", place.map(|place| place.primitive)),
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
                self.all(run, "", &leaves(one), &leaves(other));
            }
        }
    }

    /// The outputs that differ.
    pub fn unstable(self) -> Vec<Unstable> {
        let all = self.found.into_values();
        all.map(|(values, worst)| Unstable { values: values.len(), ..worst }).collect()
    }

    fn all(&mut self, run: u32, resource: &str, one: &[(String, Leaf)], other: &[(String, Leaf)]) {
        for ((path, one), (_, other)) in one.iter().zip(other) {
            let Some(spread) = spread(*one, *other).filter(|&spread| spread > self.tolerance) else {
                continue;
            };
            let name = match resource {
                "" => path.clone(),
                resource => format!("`{resource}` {path}"),
            };
            let worst = Unstable {
                name: name.clone(),
                values: 0,
                reference: words(*one),
                other: words(*other),
                run,
                spread,
            };
            let (values, known) =
                self.found.entry(format!("{resource} {}", group(path))).or_insert_with(|| {
                    let none = Unstable { spread: -1.0, ..worst.clone() };
                    (HashSet::new(), none)
                });
            values.insert(name);
            if spread > known.spread {
                *known = worst;
            }
        }
    }

    fn buffer(&self, bytes: &Bytes) -> Vec<(String, Leaf)> {
        let [set, binding, _] = bytes.binding;
        let mut leaves = Vec::new();
        match typed(self.assembled, Binding { set, binding }, &bytes.bytes) {
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

/// A path without its indices: values with one are one output.
fn group(path: &str) -> String {
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

/// How far two scalars are apart; `None` where they are equal.
fn spread(one: Leaf, other: Leaf) -> Option<f64> {
    match (one, other) {
        (Leaf::Float(one), Leaf::Float(other)) if one == other || (one.is_nan() && other.is_nan()) => None,
        (Leaf::Float(one), Leaf::Float(other)) if one.is_finite() && other.is_finite() => {
            Some((one - other).abs() / one.abs().max(1.0))
        }
        (Leaf::Integer(one), Leaf::Integer(other)) if one == other => None,
        _ => Some(f64::INFINITY),
    }
}

fn words(leaf: Leaf) -> String {
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
        assert_eq!(group("values[3].normal[0]"), "values.normal");
        assert_eq!(group("texel (3, 4).g"), "texel");
        assert_eq!(group("payload.t"), "payload.t");
    }

    #[test]
    fn floats_may_differ_a_little_and_integers_may_not() {
        assert_eq!(spread(Leaf::Float(4.0), Leaf::Float(3.0)), Some(0.25));
        assert_eq!(spread(Leaf::Float(0.5), Leaf::Float(0.25)), Some(0.25));
        assert_eq!(spread(Leaf::Float(f64::NAN), Leaf::Float(f64::NAN)), None);
        assert_eq!(spread(Leaf::Float(1.0), Leaf::Float(f64::NAN)), Some(f64::INFINITY));
        assert_eq!(spread(Leaf::Integer(7), Leaf::Integer(8)), Some(f64::INFINITY));
        assert_eq!(spread(Leaf::Integer(7), Leaf::Integer(7)), None);
    }
}
