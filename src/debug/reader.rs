//! Reads the events of a pipeline at one lane into the tree of a transcript.

use std::iter::Peekable;
use std::sync::Arc;
use std::vec::IntoIter;

use crate::accel::{
    self, Candidate, Committed, HitPrimitive, InstanceVerdict as Seen, PrimitiveVerdict as Tested, Tlas,
    TraceRay,
};
use crate::debug::names::{self, Names};
use crate::debug::query_reader::Queries;
use crate::debug::transcript::{
    Arithmetic, Decision, Ending, ExitKind, HitReport, InstanceOutcome, InstanceReport, NamedValue,
    PrimitiveOutcome, PrimitiveReport, RecordChoice, ShaderRun, Step, Trace, TranscriptLine, Traversal,
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
    /// For the events of a pipeline.
    pub fn new(pipeline: &'a Pipeline, names: Names<'a>, events: Vec<Event>) -> Self {
        Self { pipeline, names, events: events.into_iter().peekable() }
    }

    /// What the events begin with: a shader or a ray. `None` where there are none.
    pub fn root(&mut self) -> Option<Step> {
        self.steps(None).into_iter().next()
    }

    /// What stands before the end of the shader that is being read.
    fn steps(&mut self, program: Option<&'a Program>) -> Vec<Step> {
        let mut steps = Vec::new();
        let mut queries = Queries::new(program);
        loop {
            match self.events.peek() {
                Some(Event::Enter { .. }) => steps.extend(self.shader().map(Box::new).map(Step::Shader)),
                Some(Event::Trace { .. }) => steps.extend(self.trace().map(Box::new).map(Step::Trace)),
                Some(Event::RayQuery(_)) => {
                    if let Some(Event::RayQuery(event)) = self.events.next() {
                        queries.take(event, &mut steps, self);
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
            .map(|rows| rows.ty);
        let attribute = program.interface_registers(storage::HIT_ATTRIBUTE).map(|rows| rows.ty);
        let of = |ty: Option<TypeId>, words: &[u32]| Some(TypedValue::of_type(&program.module, ty?, words));
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
            exit: ending(program, exit),
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
        let mut known: Option<f32> = None;
        let mut ran = None;
        while let Some(event) = self.events.next() {
            match event {
                Event::Node(instance) => trace.traversal.open(instance),
                Event::Instance(instance, verdict) => trace.traversal.reach(instance, verdict),
                Event::Primitive(place, verdict) => trace.traversal.test(place, verdict, &mut known),
                Event::Candidate { candidate, record, shader, .. } => {
                    let shader = shader.and_then(|_| self.entered());
                    if let Some(t) = confirmed(&candidate, shader.as_ref()) {
                        known = Some(known.map_or(t, |known| known.min(t)));
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
                    trace.shader = shader.and_then(|_| self.entered()).map(Box::new);
                }
                Event::Traced { payload: after } => {
                    let ty = self.payload_type(caller, ran, after.len());
                    let of = |words: &[u32]| {
                        ty.map(|(program, ty)| TypedValue::of_type(&program.module, ty, words))
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

    /// The shader that is entered next, if one is.
    fn entered(&mut self) -> Option<ShaderRun> {
        self.events.peek().is_some_and(|event| matches!(event, Event::Enter { .. })).then(|| self.shader())?
    }

    /// The type by which a trace's payload is shown: the caller's variable's; for a ray that no
    /// shader traced, that of the shader that ran at its end, else of any that fits.
    fn payload_type(
        &self,
        caller: Option<Caller>,
        ran: Option<Shader>,
        words: usize,
    ) -> Option<(&'a Program, TypeId)> {
        let programs = &self.pipeline.programs;
        if let Some(caller) = caller {
            let program = &*programs[caller.shader.0 as usize];
            let variable = program
                .interface
                .iter()
                .find(|rows| rows.storage_class == storage::RAY_PAYLOAD && rows.first == caller.payload)?;
            return Some((program, variable.ty));
        }
        let incoming = |program: &'a Program| {
            program.interface_registers(storage::INCOMING_RAY_PAYLOAD).map(|rows| (program, rows))
        };
        let last = ran.and_then(|shader| incoming(&programs[shader.0 as usize]));
        last.or_else(|| {
            let mut all = programs.iter().filter_map(|program| incoming(program));
            all.find(|(_, rows)| rows.count as usize == words)
        })
        .map(|(program, rows)| (program, rows.ty))
    }

    /// A ray before its way.
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
            data: data.map_or_else(Vec::new, numbers),
        }
    }
}

impl Traversal {
    /// A node was opened.
    pub(super) fn open(&mut self, instance: Option<u32>) {
        match instance {
            None => self.nodes += 1,
            Some(instance) => self.instances[instance as usize].nodes += 1,
        }
    }

    /// An instance was reached.
    pub(super) fn reach(&mut self, instance: u32, verdict: Seen) {
        self.instances[instance as usize].verdict = instance_verdict(verdict);
    }

    /// A primitive was tested; `known` is the t of the closest hit known so far.
    pub(super) fn test(&mut self, place: HitPrimitive, verdict: Tested, known: &mut Option<f32>) {
        let tested = primitive(place, verdict, known);
        self.instances[place.instance as usize].tested.push(tested);
    }
}

/// The t that a decision commits, where it does.
fn confirmed(candidate: &Candidate, shader: Option<&ShaderRun>) -> Option<f32> {
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

fn ending(program: &Program, exit: Exit) -> Ending {
    let (how, trap) = match exit {
        Exit::Returned => (ExitKind::Returned, None),
        Exit::Ignored => (ExitKind::Ignored, None),
        Exit::Terminated => (ExitKind::Terminated, None),
        Exit::Trapped(trap) => (ExitKind::Trapped, Some(trap)),
    };
    Ending {
        how,
        message: trap.map(|trap| trap.code.message()),
        at: trap.and_then(|trap| names::source_line(program, trap.op)),
    }
}

fn instance_verdict(verdict: Seen) -> InstanceOutcome {
    match verdict {
        Seen::Entered => InstanceOutcome::Entered,
        Seen::Masked => InstanceOutcome::Masked,
        Seen::Skipped => InstanceOutcome::Skipped,
        Seen::Missed => InstanceOutcome::MissedBox,
    }
}

fn primitive(place: HitPrimitive, verdict: Tested, known: &mut Option<f32>) -> PrimitiveReport {
    let (verdict, found) = match verdict {
        Tested::Missed => (PrimitiveOutcome::Missed, None),
        Tested::OutsideInterval(found) => (PrimitiveOutcome::OutsideInterval, Some(found)),
        Tested::Transparent(found) => (PrimitiveOutcome::Transparent, Some(found)),
        Tested::CulledByOpacity(found) => (PrimitiveOutcome::CulledByOpacity, Some(found)),
        Tested::CulledByFace(found) => (PrimitiveOutcome::CulledByFace, Some(found)),
        Tested::Behind(found) => (PrimitiveOutcome::Behind, Some(found)),
        Tested::Opaque(found) => (PrimitiveOutcome::Opaque, Some(found)),
        Tested::Candidate(found) => (PrimitiveOutcome::Candidate, Some(found)),
    };
    let behind = known.filter(|_| verdict == PrimitiveOutcome::Behind).map(FloatValue::F32);
    if let (PrimitiveOutcome::Opaque, Some(found)) = (verdict, found) {
        *known = Some(found.t);
    }
    PrimitiveReport {
        geometry: place.geometry,
        primitive: place.primitive,
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

/// The numbers of a primitive.
fn numbers(primitive: accel::Primitive) -> Vec<NamedValue> {
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
