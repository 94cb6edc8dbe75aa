//! Rules about the input of acceleration structures that are known before anything runs.

use std::fmt;
use std::sync::Arc;

use rustc_hash::FxHashSet;

use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::rule::{Level, Rule, structure};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_engine::accel::{
    EndCaps, Geometry, GeometryData, HitPrimitive, Indexing, Motion, Tlas, TlasInstance,
};
use anyhit_engine::machine::ShaderIndex;

/// A transform whose determinant is below this times the lengths of its rows loses half of the 24
/// bits of a float.
const LEAST_DETERMINANT: f64 = 1.0 / 4096.0;

/// The acceleration structures of a scene, and what it calls their parts.
pub trait StructureNames: fmt::Debug {
    /// The structures by name.
    fn structures(&self) -> &[(String, Arc<Tlas>)];

    /// The names of an instance's geometries; fewer where they have none.
    fn geometries(&self, structure: usize, instance: u32) -> &[String];

    /// Where a geometry is described.
    fn geometry_place(&self, name: &str) -> Option<Place>;

    /// Where an instance of a structure is described.
    fn instance_place(&self, structure: usize, instance: u32) -> Option<Place>;
}

/// Checks the geometries and instances of all structures.
pub fn check_structures(names: &dyn StructureNames, levels: &Levels) -> Findings {
    let mut findings = StructureFindings { names, levels, findings: Findings::default() };
    let mut known = FxHashSet::default();
    for (at, (_, tlas)) in names.structures().iter().enumerate() {
        for (number, instance) in (0..).zip(tlas.instances()) {
            findings.instance(at, number, instance);
            let geometry_names = names.geometries(at, number);
            for (index, geometry) in instance.blas.geometries().iter().enumerate() {
                // Geometry is checked once, however many instances share it.
                let name = geometry_names.get(index);
                let is_new = match name {
                    Some(name) => known.insert((name.as_str(), 0)),
                    None => known.insert(("", std::ptr::from_ref(geometry) as usize)),
                };
                if is_new {
                    let key = known.len() as u32;
                    findings.geometry(at, number, index, key, geometry);
                }
            }
        }
    }
    findings.findings
}

/// The number of a structure among those that have names.
pub(super) fn structure_of(names: &dyn StructureNames, tlas: &Arc<Tlas>) -> Option<usize> {
    names.structures().iter().position(|(_, known)| Arc::ptr_eq(known, tlas))
}

/// The name of a geometry of an instance in messages.
pub(super) fn geometry_name(
    names: &dyn StructureNames,
    structure: Option<usize>,
    instance: u32,
    geometry: usize,
) -> String {
    match structure.and_then(|at| names.geometries(at, instance).get(geometry)) {
        Some(name) => format!("geometry `{name}`"),
        None => format!("geometry {geometry}"),
    }
}

/// The name of an instance in messages: its number, its structure where there are several, and its
/// geometries.
pub(super) fn instance_name(names: &dyn StructureNames, structure: Option<usize>, instance: u32) -> String {
    let mut text = format!("instance {instance}");
    let Some(at) = structure else { return text };
    if let [_, _, ..] = names.structures() {
        text += &format!(" of `{}`", names.structures()[at].0);
    }
    match names.geometries(at, instance) {
        [] => {}
        [one] => text += &format!(" (`{one}`)"),
        [one, ..] => text += &format!(" (`{one}`, ...)"),
    }
    text
}

/// The name of a primitive in messages: its number, its geometry and its instance.
pub fn primitive_name(names: &dyn StructureNames, tlas: &Arc<Tlas>, hit: HitPrimitive) -> String {
    let structure = names.structures().iter().position(|(_, known)| Arc::ptr_eq(known, tlas));
    let geometry = geometry_name(names, structure, hit.instance, hit.geometry as usize);
    format!("primitive {} of {geometry} in instance {}", hit.primitive, hit.instance)
}

/// The key of a finding about a part of a structure.
pub(super) fn structure_key(rule: &'static Rule, structure: usize, part: u32) -> FindingKey {
    let of_structures = ShaderIndex(u32::MAX);
    FindingKey { rule: rule.id, places: [(of_structures, structure as u32), (of_structures, part)] }
}

/// What breaks a rule in a geometry.
#[derive(Debug, PartialEq)]
struct BrokenPrimitives {
    rule: &'static Rule,
    /// How many of its primitives do.
    count: u32,
    /// What the first of them is.
    message: String,
}

/// Collects findings about structures.
#[derive(Debug)]
struct StructureFindings<'a> {
    names: &'a dyn StructureNames,
    levels: &'a Levels,
    findings: Findings,
}

impl StructureFindings<'_> {
    fn instance(&mut self, structure: usize, number: u32, instance: &TlasInstance) {
        // A null instance is in no ray's way.
        if instance.blas.geometries().is_empty() {
            return;
        }
        let name = || instance_name(self.names, Some(structure), number);
        let mut found = Vec::new();
        if instance.mask == 0 {
            found.push((
                &structure::AS_MASK_ZERO,
                format!("the mask of {} is 0: no ray meets it", name()),
                None,
            ));
        }
        found.extend(long_quaternion(instance).map(|length| {
            let message = format!("a quaternion of the SRT motion of {} has the length {length:.4}", name());
            (&structure::AS_MOTION, message, None)
        }));
        let times: &[f32] = if instance.motion.is_some() { &[0.0, 1.0] } else { &[0.0] };
        let worst = times.iter().map(|&time| relative_determinant(&instance.object_to_world(time)));
        let worst = worst.fold(f64::INFINITY, f64::min);
        if worst < LEAST_DETERMINANT {
            found.push((
                &structure::AS_NEAR_SINGULAR,
                format!(
                    "the transform of {} is nearly singular: its determinant is {worst:.1e} of what \
                     orthogonal axes give",
                    name()
                ),
                Some(format!("about {:.0} of the 24 bits of a float cancel in its inverse", -worst.log2())),
            ));
        }
        for (rule, message, note) in found {
            let place = self.names.instance_place(structure, number);
            self.add(structure_key(rule, structure, number), rule, 1, place, message, note);
        }
    }

    fn geometry(&mut self, structure: usize, instance: u32, index: usize, key: u32, geometry: &Geometry) {
        for broken in broken_primitives(geometry) {
            let name = geometry_name(self.names, Some(structure), instance, index);
            let names = self.names.geometries(structure, instance);
            let place = names.get(index).and_then(|name| self.names.geometry_place(name));
            let key = structure_key(broken.rule, usize::MAX, key);
            let message = format!("{name}: {}", broken.message);
            self.add(key, broken.rule, broken.count, place, message, None);
        }
    }

    fn add(
        &mut self,
        key: FindingKey,
        rule: &'static Rule,
        count: u32,
        place: Option<Place>,
        message: String,
        note: Option<String>,
    ) {
        let level = self.levels.of(rule);
        if level == Level::Allow {
            return;
        }
        let error = Error::new(ErrorKind::Finding, message);
        let error = place.into_iter().fold(error, Error::at);
        let error = note.into_iter().fold(error, Error::note);
        let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
        self.findings.add(key, count, Some(finding));
    }
}

/// The length of the first quaternion of an instance's motion that is not of length 1, but for
/// rounding.
fn long_quaternion(instance: &TlasInstance) -> Option<f64> {
    const TOLERANCE: f64 = 1.0 / 1024.0;
    let Some(Motion::Srt(keys)) = &instance.motion else { return None };
    let lengths =
        keys.iter().map(|key| key.quaternion.map(|x| f64::from(x).powi(2)).iter().sum::<f64>().sqrt());
    lengths.into_iter().find(|length| (length - 1.0).abs() > TOLERANCE)
}

/// The determinant of a transform's linear part against the product of the lengths of its rows, or
/// of its columns where that is more: 1 for orthogonal axes, however they are scaled.
fn relative_determinant(matrix: &[[f32; 4]; 3]) -> f64 {
    let m = matrix.map(|[x, y, z, _]| [x, y, z].map(f64::from));
    let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
    let determinant = m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1);
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let rows: f64 = (0..3).map(|row| length(m[row])).product();
    let columns: f64 = (0..3).map(|column| length([m[0][column], m[1][column], m[2][column]])).product();
    determinant.abs() / rows.min(columns)
}

/// The rules that primitives of a geometry break.
fn broken_primitives(geometry: &Geometry) -> Vec<BrokenPrimitives> {
    match &geometry.data {
        GeometryData::Triangles { vertices, indices, .. } => {
            let later = geometry.vertices_t1.as_deref();
            let keys: Vec<&[[f32; 3]]> = [Some(&vertices[..]), later].into_iter().flatten().collect();
            triangles(&keys, indices.as_deref(), geometry.data.primitive_count())
        }
        GeometryData::Aabbs(boxes) => {
            let is_point = |corners: &[f32; 6]| corners[..3] == corners[3..];
            let message = |at: usize| {
                let [x, y, z, ..] = boxes[at];
                format!("box {at} is the point ({x}, {y}, {z})")
            };
            let points = boxes.iter().enumerate().filter(|(_, corners)| is_point(corners));
            first_of(&structure::AS_DEGENERATE, points.map(|(at, _)| at), message)
        }
        GeometryData::Spheres { radii, indices, .. } => {
            let radius = |at: usize| radii[vertex(indices.as_deref(), at)];
            let points = (0..geometry.data.primitive_count()).filter(|&at| radius(at) == 0.0);
            first_of(&structure::AS_DEGENERATE, points, |at| format!("the radius of sphere {at} is 0"))
        }
        GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, end_caps } => {
            let ends = |at: usize| match indexing {
                Indexing::List => [2 * at, 2 * at + 1].map(|entry| vertex(indices.as_deref(), entry)),
                Indexing::Successive => [0, 1].map(|next| vertex(indices.as_deref(), at) + next),
            };
            let count = geometry.data.primitive_count();
            let lines = (0..count).filter(|&at| ends(at).iter().all(|&end| radii[end] == 0.0));
            let message = |at: usize| format!("both radii of linear swept sphere {at} are 0");
            let mut broken = first_of(&structure::AS_DEGENERATE, lines, message);
            if let (EndCaps::Chained, Indexing::Successive, Some(indices)) = (end_caps, indexing, indices) {
                let is_vertex = |at: usize| !radii[at].is_nan() && !positions[at].iter().any(|x| x.is_nan());
                broken.extend(chains(indices, |at| ends(at).iter().all(|&end| is_vertex(end))));
            }
            broken
        }
    }
}

/// The vertex that an entry of the indices names; without indices, its own number.
fn vertex(indices: Option<&[u32]>, entry: usize) -> usize {
    indices.map_or(entry, |indices| indices[entry] as usize)
}

/// A rule that some primitives break, with a message about the first.
fn first_of(
    rule: &'static Rule,
    mut primitives: impl Iterator<Item = usize>,
    message: impl Fn(usize) -> String,
) -> Vec<BrokenPrimitives> {
    let Some(first) = primitives.next() else { return Vec::new() };
    let count = 1 + primitives.count() as u32;
    vec![BrokenPrimitives { rule, count, message: message(first) }]
}

/// Checks triangles, whose vertices are given at each of their motion keys.
fn triangles(keys: &[&[[f32; 3]]], indices: Option<&[u32]>, count: usize) -> Vec<BrokenPrimitives> {
    let numbers = |at: usize| [3 * at, 3 * at + 1, 3 * at + 2].map(|entry| vertex(indices, entry));
    let is_nan = |[x, y, z]: &[[f32; 3]; 3]| {
        let inactive = [x, y, z].iter().any(|vertex| vertex[0].is_nan());
        !inactive && [x, y, z].iter().any(|vertex| vertex[1].is_nan() || vertex[2].is_nan())
    };
    let corners = |key: &[[f32; 3]], at: usize| numbers(at).map(|number| key[number]);
    let with_nan = (0..count).filter(|&at| keys.iter().any(|key| is_nan(&corners(key, at))));
    let mut broken = first_of(&structure::AS_VERTEX_NAN, with_nan, |at| {
        let nan = numbers(at).into_iter().find_map(|number| {
            let axis = (1..3).find(|&axis| keys.iter().any(|key| key[number][axis].is_nan()))?;
            Some(format!("{} of vertex {number} is a NaN, and its X is not", ["X", "Y", "Z"][axis]))
        });
        format!("triangle {at}: {}", nan.unwrap_or_default())
    });
    let flat = (0..count).filter(|&at| keys.iter().all(|key| degenerate(&corners(key, at)).is_some()));
    broken.extend(first_of(&structure::AS_DEGENERATE, flat, |at| match degenerate(&corners(keys[0], at)) {
        Some(Degenerate::SameVertex(pair)) => {
            let [first, second] = pair.map(|corner| numbers(at)[corner]);
            if first == second {
                format!("triangle {at} names vertex {first} twice")
            } else {
                format!("vertices {first} and {second} of triangle {at} are the same point")
            }
        }
        _ => format!("triangle {at} is a line along an axis"),
    }));
    broken
}

/// Why a triangle is never hit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Degenerate {
    /// Two of its vertices are one point.
    SameVertex([usize; 2]),
    /// Two coordinates of its three vertices are the same.
    Line,
}

/// Whether a triangle is degenerate as Vulkan defines it, which is by equal coordinates.
fn degenerate(corners: &[[f32; 3]; 3]) -> Option<Degenerate> {
    if corners.iter().any(|corner| corner[0].is_nan()) {
        return None;
    }
    let pairs = [[0, 1], [1, 2], [0, 2]];
    if let Some(pair) = pairs.into_iter().find(|&[a, b]| corners[a] == corners[b]) {
        return Some(Degenerate::SameVertex(pair));
    }
    let [a, b, c] = corners;
    let same = (0..3).filter(|&axis| a[axis] == b[axis] && b[axis] == c[axis]).count();
    (same >= 2).then_some(Degenerate::Line)
}

/// Checks chains of linear swept spheres, which go on where an index is the one before plus one.
fn chains(indices: &[u32], is_active: impl Fn(usize) -> bool) -> Vec<BrokenPrimitives> {
    let mut mixed = Vec::new();
    let mut begin = 0;
    for end in 1..=indices.len() {
        if end < indices.len() && indices[end - 1].checked_add(1) == Some(indices[end]) {
            continue;
        }
        let inactive = (begin..end).find(|&at| !is_active(at));
        if let Some(inactive) = inactive
            && (begin..end).any(&is_active)
        {
            mixed.push((begin, end, inactive));
        }
        begin = end;
    }
    let Some(&(begin, end, inactive)) = mixed.first() else { return Vec::new() };
    let message = format!(
        "linear swept sphere {inactive} is inactive, and others of its chain, {begin} to {}, are active",
        end - 1
    );
    vec![BrokenPrimitives { rule: &structure::AS_LSS_CHAIN, count: mixed.len() as u32, message }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::accel::{Blas, GeometryFlags, Srt};

    const NAN: f32 = f32::NAN;

    fn found(data: GeometryData) -> Vec<(&'static str, u32, String)> {
        let broken = broken_primitives(&Geometry::new(data, GeometryFlags::default()));
        broken.into_iter().map(|one| (one.rule.id, one.count, one.message)).collect()
    }

    fn mesh(vertices: &[[f32; 3]], indices: Option<&[u32]>) -> GeometryData {
        let indices = indices.map(<[u32]>::to_vec);
        GeometryData::Triangles { vertices: vertices.to_vec(), indices, transform: None }
    }

    #[test]
    fn a_nan_in_x_makes_a_triangle_inactive_and_one_elsewhere_breaks_the_rule() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let with = |vertex: usize, axis: usize| {
            let mut corners = corners;
            corners[vertex][axis] = NAN;
            corners
        };
        assert_eq!(found(mesh(&with(1, 0), None)), []);
        assert_eq!(found(mesh(&[[NAN; 3]; 3], None)), []);
        let message = "triangle 0: Z of vertex 2 is a NaN, and its X is not".to_owned();
        assert_eq!(found(mesh(&with(2, 2), None)), [("as-vertex-nan", 1, message)]);
        // No triangle names the vertex.
        let mut more = corners.to_vec();
        more.push([0.0, NAN, 0.0]);
        assert_eq!(found(mesh(&more, Some(&[0, 1, 2]))), []);
    }

    #[test]
    fn triangles_are_degenerate_by_equal_coordinates() {
        let vertices =
            [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0; 3], [1.0, 1.0, 0.0], [2.0, 2.0, 0.0]];
        let one = |indices: [u32; 3]| found(mesh(&vertices, Some(&indices)));
        let told = |text: &str| vec![("as-degenerate", 1, text.to_owned())];
        assert_eq!(one([0, 1, 1]), told("triangle 0 names vertex 1 twice"));
        assert_eq!(one([0, 1, 3]), told("vertices 0 and 3 of triangle 0 are the same point"));
        assert_eq!(one([0, 1, 2]), told("triangle 0 is a line along an axis"));
        // A line along no axis is not degenerate by definition.
        assert_eq!(one([0, 4, 5]), []);
        let three = found(mesh(&vertices, Some(&[0, 1, 4, 0, 1, 1, 2, 2, 2])));
        assert_eq!(three, [("as-degenerate", 2, "triangle 1 names vertex 1 twice".to_owned())]);
    }

    #[test]
    fn points_and_radii_of_zero_are_degenerate() {
        let boxes = vec![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], [1.0, 2.0, 3.0, 1.0, 2.0, 3.0], [NAN; 6]];
        let message = "box 1 is the point (1, 2, 3)".to_owned();
        assert_eq!(found(GeometryData::Aabbs(boxes)), [("as-degenerate", 1, message)]);
        let (positions, radii) = (vec![[0.0; 3]; 3], vec![1.0, 0.0, 0.0]);
        let spheres =
            GeometryData::Spheres { positions: positions.clone(), radii: radii.clone(), indices: None };
        let message = "the radius of sphere 1 is 0".to_owned();
        assert_eq!(found(spheres), [("as-degenerate", 2, message)]);
        let (indices, indexing, end_caps) = (Some(vec![0, 1]), Indexing::Successive, EndCaps::Chained);
        let swept = GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, end_caps };
        let message = "both radii of linear swept sphere 1 are 0".to_owned();
        assert_eq!(found(swept), [("as-degenerate", 1, message)]);
    }

    #[test]
    fn a_chain_is_active_or_inactive_as_a_whole() {
        let chain = |indices: Vec<u32>, end_caps: EndCaps, nan: usize| {
            let mut positions = vec![[0.0; 3]; 6];
            positions[nan] = [0.0, 0.0, NAN];
            let (radii, indexing) = (vec![1.0; 6], Indexing::Successive);
            let indices = Some(indices);
            found(GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, end_caps })
        };
        let message =
            "linear swept sphere 1 is inactive, and others of its chain, 0 to 2, are active".to_owned();
        let broken = [("as-lss-chain", 1, message)];
        assert_eq!(chain(vec![0, 2, 3], EndCaps::Chained, 3), []);
        assert_eq!(chain(vec![1, 2, 3], EndCaps::Chained, 3).len(), 1);
        assert_eq!(chain(vec![0, 1, 2, 4], EndCaps::Chained, 2), broken);
        // The vertex is the end of no segment, or caps are not chained.
        assert_eq!(chain(vec![0, 1, 4], EndCaps::Chained, 3), []);
        assert_eq!(chain(vec![0, 1, 2, 3], EndCaps::None, 2), []);
        // A chain of one is inactive as a whole.
        assert_eq!(chain(vec![0, 3], EndCaps::Chained, 0), []);
    }

    #[test]
    fn rotations_of_motions_have_length_one() {
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let data = GeometryData::Triangles { vertices, indices: None, transform: None };
        let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::default())]).expect("a triangle");
        let length = |quaternion: [f32; 4]| {
            let motion = Motion::Srt(Box::new([Srt::default(), Srt { quaternion, ..Srt::default() }]));
            let matrix = motion.at(0.0).expect("a transform");
            long_quaternion(&TlasInstance { motion: Some(motion), ..TlasInstance::of(blas.clone(), matrix) })
        };
        assert_eq!(length([0.0, 3.0, 0.0, 4.0]), Some(5.0));
        let half = std::f32::consts::FRAC_1_SQRT_2;
        assert_eq!(length([0.0, half, 0.0, -half]), None);
    }

    #[test]
    fn scales_are_no_reason_to_call_a_transform_nearly_singular() {
        let of = |m: [[f32; 3]; 3]| relative_determinant(&m.map(|[x, y, z]| [x, y, z, 5.0]));
        assert_eq!(of([[1e-6, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1e6]]), 1.0);
        // Rotated by 45 degrees before it is flattened, and after.
        assert!(of([[1.0, 1.0, 0.0], [-1e-6, 1e-6, 0.0], [0.0, 0.0, 1.0]]) > 0.99);
        assert!(of([[1.0, -1e-6, 0.0], [1.0, 1e-6, 0.0], [0.0, 0.0, 1.0]]) > 0.99);
        // Two axes that nearly are one.
        assert!(of([[1.0, 1.0, 0.0], [1.0, 1.0001, 0.0], [0.0, 0.0, 1.0]]) < LEAST_DETERMINANT);
    }
}
