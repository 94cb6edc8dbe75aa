//! Reads the events of a pipeline at one lane into the tree of a transcript.

use std::iter::Peekable;
use std::sync::Arc;
use std::vec::IntoIter;

use crate::accel::{
    self, Candidate, Committed, HitPrimitive, InstanceVerdict, PrimitiveVerdict, Tlas, TraceRay,
};
use crate::debug::names::{self, Names};
use crate::debug::query_reader::QueryReader;
use crate::debug::transcript::{
    Arithmetic, Decision, ExitKind, HitReport, InstanceOutcome, InstanceReport, NamedValue, PrimitiveOutcome,
    PrimitiveReport, RecordChoice, ShaderExit, ShaderRun, Step, Trace, TranscriptLine, Traversal,
};
use crate::debug::values::{FloatValue, TypedValue, ValueContent};
use crate::geometry::{Intersection, Surface};
use crate::machine::Exit;
use crate::module::ty::TypeId;
use crate::ops::pointer::storage;
use crate::pipeline::{Caller, Event, Pipeline, Shader};
use crate::program::Program;

const SKIP_CLOSEST_HIT: u32 = 8;

/// Reads events into steps.
pub struct EventReader<'a> {
    pipeline: &'a Pipeline,
    names: Names<'a>,
    events: Peekable<IntoIter<Event>>,
}

impl<'a> EventReader<'a> {
    /// A reader of the events of a pipeline.
    pub fn new(pipeline: &'a Pipeline, names: Names<'a>, events: Vec<Event>) -> Self {
        Self { pipeline, names, events: events.into_iter().peekable() }
    }

    /// Reads the first step, a shader or a ray; `None` if there are no events.
    pub fn root(&mut self) -> Option<Step> {
        self.steps(None).into_iter().next()
    }

    /// Reads the steps up to the end of the current shader.
    fn steps(&mut self, program: Option<&'a Program>) -> Vec<Step> {
        let mut steps = Vec::new();
        let mut queries = QueryReader::new(program);
        loop {
            match self.events.peek() {
                Some(Event::Enter { .. }) => steps.extend(self.shader().map(Box::new).map(Step::Shader)),
                Some(Event::Trace { .. }) => steps.extend(self.trace().map(Box::new).map(Step::Trace)),
                Some(Event::RayQuery(_)) => {
                    if let Some(Event::RayQuery(event)) = self.events.next() {
                        queries.read(event, &mut steps, self);
                    }
                }
                Some(&Event::Report { t, hit_kind, accepted }) => {
                    self.events.next();
                    steps.push(Step::Report { t: FloatValue::F32(t), hit_kind: hit_kind.0, accepted });
                }
                _ => return steps,
            }
        }
    }

    fn shader(&mut self) -> Option<ShaderRun> {
        let Event::Enter { shader, builtins, payload, attributes, .. } = self.events.next()? else {
            return None;
        };
        let program = &*self.pipeline.programs[shader.0 as usize];
        let data = [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA]
            .into_iter()
            .find_map(|class| program.interface_registers(class))
            .map(|registers| registers.ty);
        let attribute = program.interface_registers(storage::HIT_ATTRIBUTE).map(|registers| registers.ty);
        let names = self.names;
        let of = |ty: Option<TypeId>, words: &[u32]| {
            Some(names.value(TypedValue::of_type(&program.module, ty?, words)))
        };
        let steps = self.steps(Some(program));
        let (exit, after) = match self.events.next() {
            Some(Event::Leave { exit, payload, .. }) => (exit, payload),
            _ => (Exit::Returned, payload.clone()),
        };
        Some(ShaderRun {
            shader: self.names.shader(shader),
            builtins: builtins
                .iter()
                .map(|(builtin, words)| NamedValue {
                    name: builtin.name,
                    value: TypedValue::of_builtin(builtin, words),
                })
                .collect(),
            attributes: of(attribute, &attributes),
            payload_before: of(data, &payload),
            payload_after: of(data, &after),
            steps,
            exit: shader_exit(program, exit),
        })
    }

    fn trace(&mut self) -> Option<Trace> {
        let Event::Trace { caller, tlas, depth, trace: operands, sbt, payload, .. } = self.events.next()?
        else {
            return None;
        };
        let called_at = caller.and_then(|caller| {
            names::source_line(&self.pipeline.programs[caller.shader.0 as usize], caller.op)
        });
        let mut trace = Trace {
            depth,
            traversal: self.traversal(called_at, &tlas, &operands),
            sbt_offset: sbt[0],
            sbt_stride: sbt[1],
            miss_index: sbt[2],
            payload_before: None,
            payload_after: None,
            decisions: Vec::new(),
            hit: None,
            record: None,
            shader: None,
            no_shader: None,
        };
        // The t of the closest hit known so far.
        let mut closest: Option<f32> = None;
        let mut ran = None;
        while let Some(event) = self.events.next() {
            match event {
                Event::Node(instance) => trace.traversal.count_node(instance),
                Event::Instance(instance, verdict) => trace.traversal.set_instance_verdict(instance, verdict),
                Event::Primitive(hit_primitive, verdict) => {
                    trace.traversal.add_tested_primitive(hit_primitive, verdict, &mut closest)
                }
                Event::Candidate { candidate, record, shader, .. } => {
                    let shader = shader.and_then(|_| self.next_shader());
                    if let Some(t) = committed_t(&candidate, shader.as_ref()) {
                        closest = Some(closest.map_or(t, |closest| closest.min(t)));
                    }
                    trace.decisions.push(Decision {
                        instance: candidate.instance,
                        geometry: candidate.geometry,
                        primitive: candidate.primitive,
                        t: FloatValue::F32(candidate.intersection.t),
                        is_box: candidate.is_box(),
                        record: self.hit_record(&tlas, &candidate, sbt, record),
                        shader,
                    });
                }
                Event::Traversed { committed, record, shader, to_hit_object } => {
                    trace.hit = committed.map(|committed| self.hit(&tlas, &operands, &committed));
                    trace.record = Some(match &committed {
                        Some(committed) => self.hit_record(&tlas, &committed.candidate, sbt, record),
                        None => self.miss_record(record),
                    });
                    trace.no_shader = match shader {
                        Some(_) => None,
                        None if to_hit_object => Some("the hit object keeps it to be executed later".into()),
                        None => Some(self.no_shader(&trace)),
                    };
                    ran = shader;
                    trace.shader = shader.and_then(|_| self.next_shader()).map(Box::new);
                }
                Event::Traced { payload: after } => {
                    let ty = self.payload_type(caller, ran, after.len());
                    let names = self.names;
                    let of = |words: &[u32]| {
                        ty.map(|(program, ty)| names.value(TypedValue::of_type(&program.module, ty, words)))
                    };
                    trace.payload_before = of(&payload);
                    trace.payload_after = of(&after);
                    return Some(trace);
                }
                _ => {}
            }
        }
        Some(trace)
    }

    /// Reads the next shader, if the next event is the begin of one.
    fn next_shader(&mut self) -> Option<ShaderRun> {
        self.events.peek().is_some_and(|event| matches!(event, Event::Enter { .. })).then(|| self.shader())?
    }

    /// The type by which a trace's payload is shown: that of the caller's variable. For a ray from
    /// the host it is the type that the last shader declares, otherwise any declared type of that
    /// size.
    fn payload_type(
        &self,
        caller: Option<Caller>,
        ran: Option<Shader>,
        words: usize,
    ) -> Option<(&'a Program, TypeId)> {
        let programs = &self.pipeline.programs;
        if let Some(caller) = caller {
            let program = &*programs[caller.shader.0 as usize];
            let variable = program.interface.iter().find(|registers| {
                registers.storage_class == storage::RAY_PAYLOAD && registers.first == caller.payload
            })?;
            return Some((program, variable.ty));
        }
        let incoming = |program: &'a Program| {
            program.interface_registers(storage::INCOMING_RAY_PAYLOAD).map(|registers| (program, registers))
        };
        let last = ran.and_then(|shader| incoming(&programs[shader.0 as usize]));
        last.or_else(|| {
            let mut all = programs.iter().filter_map(|program| incoming(program));
            all.find(|(_, registers)| registers.count as usize == words)
        })
        .map(|(program, registers)| (program, registers.ty))
    }

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
            structure: self.names.structure(tlas).map(|(_, name)| name.to_owned()),
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
            instances: self.instances(tlas),
        }
    }

    fn instances(&self, tlas: &Arc<Tlas>) -> Vec<InstanceReport> {
        let one = |(number, instance): (usize, &accel::TlasInstance)| InstanceReport {
            instance: number as u32,
            geometry: self.names.geometry(tlas, number as u32).to_vec(),
            primitive_kind: instance.blas.kind().map(|kind| kind.to_string()),
            primitives: instance.blas.geometries().iter().map(|one| one.data.primitive_count()).sum(),
            mask: instance.mask,
            custom_index: instance.custom_index,
            transformed: instance.motion.is_some()
                || instance.transform != [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            moves: instance.motion.is_some() || instance.blas.moves(),
            verdict: InstanceOutcome::NotReached,
            nodes: 0,
            tested: Vec::new(),
        };
        tlas.instances().iter().enumerate().map(one).collect()
    }

    fn hit_record(&self, tlas: &Arc<Tlas>, candidate: &Candidate, sbt: [u32; 3], index: u64) -> RecordChoice {
        let instance = &tlas.instances()[candidate.instance as usize];
        let arithmetic = Arithmetic {
            instance_offset: instance.sbt_record_offset,
            geometry: candidate.geometry,
            stride: sbt[1] & 0xF,
            offset: sbt[0] & 0xF,
        };
        debug_assert_eq!(
            accel::hit_record_index(instance.sbt_record_offset, candidate.geometry, sbt[1], sbt[0]),
            index
        );
        let records = &self.pipeline.sbt.hit;
        let record = usize::try_from(index).ok().and_then(|at| records.get(at)).and_then(Option::as_ref);
        RecordChoice {
            table: "hit",
            index,
            arithmetic: Some(arithmetic),
            records: records.len(),
            name: self.names.hit_record(index),
            group: record.map(|record| record.group),
        }
    }

    fn miss_record(&self, index: u64) -> RecordChoice {
        let records = &self.pipeline.sbt.miss;
        let record = usize::try_from(index).ok().and_then(|at| records.get(at)).and_then(Option::as_ref);
        RecordChoice {
            table: "miss",
            index,
            arithmetic: None,
            records: records.len(),
            name: self.names.miss_record(index),
            group: record.map(|record| record.group),
        }
    }

    /// Why no closest-hit or miss shader runs.
    fn no_shader(&self, trace: &Trace) -> String {
        let Some(record) = &trace.record else { return String::new() };
        if record.index >= record.records as u64 {
            let (table, index, records) = (record.table, record.index, record.records);
            return format!("the {table} table has no record {index}, only {records}");
        }
        if record.group.is_none() {
            return "the record is a null handle".into();
        }
        if trace.hit.is_some() && trace.traversal.flags.bits & SKIP_CLOSEST_HIT != 0 {
            return "the ray's flag SkipClosestHitShaderKHR".into();
        }
        "the group has no closest-hit shader".into()
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
        let data = instance.blas.primitive(candidate.geometry, candidate.primitive, operands.time);
        HitReport {
            instance: candidate.instance,
            custom_index: instance.custom_index,
            geometry: candidate.geometry,
            geometry_name: self
                .names
                .geometry(tlas, candidate.instance)
                .get(candidate.geometry as usize)
                .cloned(),
            primitive: candidate.primitive,
            t: FloatValue::F32(t),
            hit_kind: hit_kind.0,
            hit_kind_name: names::hit_kind(hit_kind),
            surface: names::surface(candidate.intersection.surface),
            attributes: attributes(&candidate.intersection),
            position,
            object_ray_origin: origin.map(FloatValue::F32),
            object_ray_direction: direction.map(FloatValue::F32),
            data: data.map_or_else(Vec::new, primitive_data),
        }
    }
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

/// The t that a decision commits, if it commits a hit.
fn committed_t(candidate: &Candidate, shader: Option<&ShaderRun>) -> Option<f32> {
    if candidate.is_box() {
        let accepted = |step: &Step| match step {
            Step::Report { t: FloatValue::F32(t), accepted: true, .. } => Some(*t),
            _ => None,
        };
        return shader?.steps.iter().filter_map(accepted).reduce(f32::min);
    }
    let kept = shader.is_none_or(|run| matches!(run.exit.how, ExitKind::Returned | ExitKind::Terminated));
    kept.then_some(candidate.intersection.t)
}

fn shader_exit(program: &Program, exit: Exit) -> ShaderExit {
    let (how, trap) = match exit {
        Exit::Returned => (ExitKind::Returned, None),
        Exit::Ignored => (ExitKind::Ignored, None),
        Exit::Terminated => (ExitKind::Terminated, None),
        Exit::Trapped(trap) => (ExitKind::Trapped, Some(trap)),
    };
    ShaderExit {
        how,
        message: trap.map(|trap| trap.code.message()),
        at: trap.and_then(|trap| names::source_line(program, trap.op)),
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
    let (verdict, found) = match verdict {
        PrimitiveVerdict::Missed => (PrimitiveOutcome::Missed, None),
        PrimitiveVerdict::OutsideInterval(found) => (PrimitiveOutcome::OutsideInterval, Some(found)),
        PrimitiveVerdict::Transparent(found) => (PrimitiveOutcome::Transparent, Some(found)),
        PrimitiveVerdict::CulledByOpacity(found) => (PrimitiveOutcome::CulledByOpacity, Some(found)),
        PrimitiveVerdict::CulledByFace(found) => (PrimitiveOutcome::CulledByFace, Some(found)),
        PrimitiveVerdict::Behind(found) => (PrimitiveOutcome::Behind, Some(found)),
        PrimitiveVerdict::Opaque(found) => (PrimitiveOutcome::Opaque, Some(found)),
        PrimitiveVerdict::Candidate(found) => (PrimitiveOutcome::Candidate, Some(found)),
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
    NamedValue { name, value: TypedValue { ty: ty.to_owned(), content } }
}
