//! The reports on a ray, on what its traversal reached and on its hit.

use std::sync::Arc;

use crate::names::{self, Names};
use crate::transcript::{
    HitReport, InstanceOutcome, InstanceReport, NamedValue, PrimitiveOutcome, PrimitiveReport,
    TranscriptLine, Traversal,
};
use anyhit_engine::accel::geometry::primitive_count;
use anyhit_engine::accel::{
    self, Committed, HitPrimitive, InstanceVerdict, PrimitiveVerdict, Tlas, TraceRay, surface_normal,
};
use anyhit_engine::geometry::{Bounds, Intersection, Surface};
use anyhit_engine::math::array;
use anyhit_engine::reflect::value::{FloatValue, TypedValue, ValueContent};

impl Names<'_> {
    /// A ray before its traversal.
    pub(super) fn traversal(
        &self,
        called_at: Option<TranscriptLine>,
        tlas: &Arc<Tlas>,
        operands: &TraceRay,
    ) -> Traversal {
        let ray = operands.ray;
        let length = ray.direction.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
        Traversal {
            structure: self.structure(tlas).map(|(_, name)| name.to_owned()),
            called_at,
            origin: ray.origin.map(FloatValue::F32),
            direction: ray.direction.map(FloatValue::F32),
            direction_length: FloatValue::F32(length as f32),
            t_min: FloatValue::F32(ray.t_min),
            t_max: FloatValue::F32(ray.t_max),
            flags: names::flags(operands.flags.0),
            cull_mask: operands.cull_mask,
            time: (tlas.moves() || operands.time != 0.0).then_some(FloatValue::F32(operands.time)),
            nodes: 0,
            instances: self.instances(tlas, operands.time),
        }
    }

    fn instances(&self, tlas: &Arc<Tlas>, time: f32) -> Vec<InstanceReport> {
        let one = |(number, instance): (usize, &accel::TlasInstance)| InstanceReport {
            instance: number as u32,
            geometry: self.geometry(tlas, number as u32).to_vec(),
            primitive_kind: instance.blas.kind().map(|kind| kind.to_string()),
            primitives: primitive_count(instance.blas.geometries()),
            mask: instance.mask,
            custom_index: instance.custom_index,
            bounds: world_bounds(instance, time).map(|corners| corners.map(|one| one.map(FloatValue::F32))),
            transformed: instance.motion.is_some()
                || instance.transform != [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            moves: instance.motion.is_some() || instance.blas.moves(),
            verdict: InstanceOutcome::NotReached,
            nodes: 0,
            tested: Vec::new(),
        };
        tlas.instances().iter().enumerate().map(one).collect()
    }

    pub(super) fn hit(&self, tlas: &Arc<Tlas>, operands: &TraceRay, committed: &Committed) -> HitReport {
        let Committed { candidate, t, hit_kind } = *committed;
        let instance = &tlas.instances()[candidate.instance as usize];
        let ray = operands.ray;
        let position = std::array::from_fn(|axis| {
            let exact = f64::from(ray.direction[axis]) * f64::from(t) + f64::from(ray.origin[axis]);
            FloatValue::F32(exact as f32)
        });
        let object_ray = tlas.object_ray(candidate.instance, &ray, operands.time);
        let (origin, direction) = object_ray
            .map_or((ray.origin, ray.direction), |ray| (ray.object_origin_f32(), ray.object_direction_f32()));
        let normal = surface_normal(tlas, operands, candidate.hit_primitive());
        let data = instance.blas.primitive(candidate.geometry, candidate.primitive, operands.time);
        HitReport {
            instance: candidate.instance,
            custom_index: instance.custom_index,
            geometry: candidate.geometry,
            geometry_name: self.geometry(tlas, candidate.instance).get(candidate.geometry as usize).cloned(),
            primitive: candidate.primitive,
            t: FloatValue::F32(t),
            hit_kind: hit_kind.0,
            hit_kind_name: names::hit_kind(hit_kind),
            surface: names::surface(candidate.intersection.surface),
            attributes: attributes(&candidate.intersection),
            position,
            normal: normal.map(|normal| normal.world.map(FloatValue::F32)),
            object_normal: normal.map(|normal| normal.object.map(FloatValue::F32)),
            object_ray_origin: origin.map(FloatValue::F32),
            object_ray_direction: direction.map(FloatValue::F32),
            data: data.map_or_else(Vec::new, primitive_data),
        }
    }
}

/// The box around an instance in world space: the least and the greatest coordinates of the
/// corners of its box in object space.
fn world_bounds(instance: &accel::TlasInstance, time: f32) -> Option<[[f32; 3]; 2]> {
    let bounds = instance.blas.bounds();
    let is_empty = (0..3).any(|axis| bounds.min[axis] > bounds.max[axis]);
    let rows = instance.object_to_world(time);
    let corner = |number: usize| -> [f32; 3] {
        let of = |axis: usize| if number >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        rows.map(|[x, y, z, w]| x * of(0) + y * of(1) + z * of(2) + w)
    };
    let corners: [[f32; 3]; 8] = array::from_fn(corner);
    let bounds = Bounds::of_points(&corners);
    (!is_empty).then_some([bounds.min, bounds.max])
}

impl Traversal {
    /// Counts an opened node.
    pub(super) fn count_node(&mut self, instance: Option<u32>) {
        match instance {
            None => self.nodes += 1,
            Some(instance) => self.instances[instance as usize].nodes += 1,
        }
    }

    /// Sets the verdict on an instance that traversal reached.
    pub(super) fn set_instance_verdict(&mut self, instance: u32, verdict: InstanceVerdict) {
        self.instances[instance as usize].verdict = instance_verdict(verdict);
    }

    /// Adds a tested primitive. `closest` is the t of the closest hit so far, and is updated.
    pub(super) fn add_tested_primitive(
        &mut self,
        hit_primitive: HitPrimitive,
        verdict: PrimitiveVerdict,
        closest: &mut Option<f32>,
    ) {
        let tested = primitive(hit_primitive, verdict, closest);
        self.instances[hit_primitive.instance as usize].tested.push(tested);
    }
}

fn instance_verdict(verdict: InstanceVerdict) -> InstanceOutcome {
    match verdict {
        InstanceVerdict::Entered => InstanceOutcome::Entered,
        InstanceVerdict::Masked => InstanceOutcome::Masked,
        InstanceVerdict::Skipped => InstanceOutcome::Skipped,
        InstanceVerdict::Missed => InstanceOutcome::MissedBox,
    }
}

fn primitive(
    hit_primitive: HitPrimitive,
    verdict: PrimitiveVerdict,
    closest: &mut Option<f32>,
) -> PrimitiveReport {
    let found = verdict.intersection();
    let verdict = match verdict {
        PrimitiveVerdict::Missed => PrimitiveOutcome::Missed,
        PrimitiveVerdict::OutsideInterval(_) => PrimitiveOutcome::OutsideInterval,
        PrimitiveVerdict::Transparent(_) => PrimitiveOutcome::Transparent,
        PrimitiveVerdict::CulledByOpacity(_) => PrimitiveOutcome::CulledByOpacity,
        PrimitiveVerdict::CulledByFace(_) => PrimitiveOutcome::CulledByFace,
        PrimitiveVerdict::Behind(_) => PrimitiveOutcome::Behind,
        PrimitiveVerdict::Opaque(_) => PrimitiveOutcome::Opaque,
        PrimitiveVerdict::Candidate(_) => PrimitiveOutcome::Candidate,
    };
    let behind = closest.filter(|_| verdict == PrimitiveOutcome::Behind).map(FloatValue::F32);
    if let (PrimitiveOutcome::Opaque, Some(found)) = (verdict, found) {
        *closest = Some(found.t);
    }
    PrimitiveReport {
        geometry: hit_primitive.geometry,
        primitive: hit_primitive.primitive,
        verdict,
        t: found.map(|found| FloatValue::F32(found.t)),
        surface: found.map(|found| names::surface(found.surface)),
        behind,
    }
}

fn attributes(found: &Intersection) -> Vec<NamedValue> {
    let [a, b] = found.attributes;
    match found.surface {
        Surface::TriangleFront | Surface::TriangleBack => {
            vec![named("barycentrics", "vec2", ValueContent::vector([a, b]))]
        }
        Surface::Side | Surface::Cap0 | Surface::Cap1 => vec![named("u", "float", ValueContent::f32(a))],
        Surface::Aabb | Surface::Sphere => Vec::new(),
    }
}

/// The vertices, positions, radii or bounds of a primitive.
fn primitive_data(primitive: accel::Primitive) -> Vec<NamedValue> {
    match primitive {
        accel::Primitive::Triangle(vertices) => {
            vec![named(
                "vertices",
                "vec3[3]",
                ValueContent::List(vertices.map(ValueContent::vector).to_vec()),
            )]
        }
        accel::Primitive::Aabb([x0, y0, z0, x1, y1, z1]) => vec![
            named("minimum", "vec3", ValueContent::vector([x0, y0, z0])),
            named("maximum", "vec3", ValueContent::vector([x1, y1, z1])),
        ],
        accel::Primitive::Sphere { position, radius } => vec![
            named("position", "vec3", ValueContent::vector(position)),
            named("radius", "float", ValueContent::f32(radius)),
        ],
        accel::Primitive::LinearSweptSphere { positions, radii, caps } => vec![
            named("positions", "vec3[2]", ValueContent::List(positions.map(ValueContent::vector).to_vec())),
            named("radii", "float[2]", ValueContent::vector(radii)),
            named("caps", "bool[2]", ValueContent::List(caps.map(ValueContent::Bool).to_vec())),
        ],
    }
}

fn named(name: &'static str, ty: &str, content: ValueContent) -> NamedValue {
    NamedValue { name, source_name: None, value: TypedValue { ty: ty.to_owned(), content } }
}
