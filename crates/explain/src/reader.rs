//! Reads the events of a pipeline at one lane into the tree of a transcript.

use std::iter::Peekable;
use std::sync::Arc;
use std::vec::IntoIter;

use crate::builtin_names::source_name;
use crate::executed_lines::PrintedText;
use crate::given_block::given_block;
use crate::layout::{declared_size, members, of_record};
use crate::names::{self, Names};
use crate::query_reader::QueryReader;
use crate::transcript::{
    Arithmetic, Decision, ExitKind, NamedValue, RecordChoice, RecordData, RecordMember, ShaderExit,
    ShaderRun, Step, Trace,
};
use anyhit_engine::accel::{Candidate, RecordIndex, Tlas};
use anyhit_engine::machine::{Buffer, Exit, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::ty::TypeId;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::{Caller, Event, Pipeline, SbtRecord};
use anyhit_engine::program::Program;
use anyhit_engine::reflect::value::{FloatValue, TypedValue};

const SKIP_CLOSEST_HIT: u32 = 8;

/// How many members of a shader record are shown.
const MAX_RECORD_MEMBERS: usize = 32;

/// Reads events into steps.
#[derive(Debug)]
pub struct EventReader<'a> {
    pipeline: &'a Pipeline,
    names: Names<'a>,
    events: Peekable<IntoIter<Event>>,
    /// How many events were read.
    read: usize,
    /// What was printed, each with the number of events before it.
    printed: Peekable<IntoIter<(usize, String)>>,
    /// How many of these texts were read.
    texts: usize,
    /// How many shaders have begun.
    begun: u64,
    /// The data of the record of the hit shader that runs, which any-hit shaders of its reports
    /// have, too.
    hit_data: Option<Arc<Buffer>>,
}

impl<'a> EventReader<'a> {
    /// A reader of the events of a pipeline.
    pub fn new(pipeline: &'a Pipeline, names: Names<'a>, events: Vec<Event>) -> Self {
        let printed = Vec::new().into_iter().peekable();
        Self {
            pipeline,
            names,
            events: events.into_iter().peekable(),
            read: 0,
            printed,
            texts: 0,
            begun: 0,
            hit_data: None,
        }
    }

    /// Gives what the shaders printed, each text with the number of events before it.
    #[must_use]
    pub fn with_printed(self, printed: Vec<(usize, String)>) -> Self {
        Self { printed: printed.into_iter().peekable(), ..self }
    }

    fn next_event(&mut self) -> Option<Event> {
        self.read += 1;
        self.events.next()
    }

    /// Reads the first step, a shader or a ray; `None` if there are no events.
    pub fn root(&mut self) -> Option<Step> {
        self.steps(None).0.into_iter().next()
    }

    /// Reads the steps up to the end of the current shader, and what it printed itself.
    fn steps(&mut self, program: Option<&'a Program>) -> (Vec<Step>, Vec<PrintedText>) {
        let mut steps = Vec::new();
        let mut printed = Vec::new();
        let mut queries = QueryReader::new(program);
        loop {
            while let Some((_, text)) = self.printed.next_if(|(before, _)| *before <= self.read) {
                let number = self.texts;
                self.texts += 1;
                printed.push(PrintedText { text, number, steps_before: steps.len(), file: None, line: None });
            }
            match self.events.peek() {
                Some(&Event::Enter { stage, .. }) => {
                    let data = match stage {
                        Stage::RayGeneration => data_of(self.pipeline.sbt.ray_generation.as_ref()),
                        Stage::AnyHit => self.hit_data.clone(),
                        _ => None,
                    };
                    steps.extend(self.shader(data).map(Box::new).map(Step::Shader));
                }
                Some(Event::Trace { .. }) => steps.extend(self.trace().map(Box::new).map(Step::Trace)),
                Some(Event::RayQuery(_)) => {
                    if let Some(Event::RayQuery(event)) = self.next_event() {
                        queries.read(event, &mut steps, &self.names);
                    }
                }
                Some(&Event::Report { t, hit_kind, accepted }) => {
                    self.next_event();
                    steps.push(Step::Report { t: FloatValue::F32(t), hit_kind: hit_kind.0, accepted });
                }
                _ => return (steps, printed),
            }
        }
    }

    fn shader(&mut self, record: Option<Arc<Buffer>>) -> Option<ShaderRun> {
        let Event::Enter { shader, builtins, payload, attributes, push_constants, .. } = self.next_event()?
        else {
            return None;
        };
        let run = self.begun;
        self.begun += 1;
        let program = &*self.pipeline.programs[shader.index()];
        let data = [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA]
            .into_iter()
            .find_map(|class| program.interface_registers(class))
            .map(|registers| registers.ty);
        let attribute = program.interface_registers(storage::HIT_ATTRIBUTE).map(|registers| registers.ty);
        let names = self.names;
        let of = |ty: Option<TypeId>, words: &[u32]| {
            Some(names.value(TypedValue::of_type(&program.module, ty?, words)))
        };
        let outer = std::mem::replace(&mut self.hit_data, record.clone());
        let (steps, printed) = self.steps(Some(program));
        self.hit_data = outer;
        let (exit, after) = match self.next_event() {
            Some(Event::Leave { exit, payload, .. }) => (exit, payload),
            _ => (Exit::Returned, payload.clone()),
        };
        Some(ShaderRun {
            run,
            shader: self.names.shader(shader),
            builtins: builtins
                .iter()
                .map(|(builtin, words)| NamedValue {
                    name: builtin.name,
                    source_name: source_name(program.module.generator, program.stage, builtin.name),
                    value: TypedValue::of_builtin(builtin, words),
                })
                .collect(),
            attributes: of(attribute, &attributes),
            record: record.and_then(|record| record_data(program, &record, &names)),
            push_constants: push_constants
                .and_then(|data| given_block(|value| names.value(value), program, &data)),
            payload_before: of(data, &payload),
            payload_after: of(data, &after),
            steps,
            lines: Vec::new(),
            printed,
            exit: shader_exit(program, exit),
        })
    }

    fn trace(&mut self) -> Option<Trace> {
        let Event::Trace { caller, tlas, depth, trace: operands, sbt, payload, .. } = self.next_event()?
        else {
            return None;
        };
        let called_at = caller
            .and_then(|caller| names::source_line(&self.pipeline.programs[caller.shader.index()], caller.op));
        let mut trace = Trace {
            depth,
            traversal: self.names.traversal(called_at, &tlas, &operands),
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
        while let Some(event) = self.next_event() {
            match event {
                Event::Node(instance) => trace.traversal.count_node(instance),
                Event::Instance(instance, verdict) => trace.traversal.set_instance_verdict(instance, verdict),
                Event::Primitive(hit_primitive, verdict) => {
                    trace.traversal.add_tested_primitive(hit_primitive, verdict, &mut closest)
                }
                Event::Candidate { candidate, record, shader, .. } => {
                    let data = data_of(record.get(&self.pipeline.sbt.hit).and_then(Option::as_ref));
                    let shader = shader.and_then(|_| self.next_shader(data));
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
                Event::Traversed { committed, record, shader, to_hit_object, .. } => {
                    trace.hit = committed.map(|committed| self.names.hit(&tlas, &operands, &committed));
                    trace.record = Some(match &committed {
                        Some(committed) => self.hit_record(&tlas, &committed.candidate, sbt, record),
                        None => self.miss_record(record),
                    });
                    trace.no_shader = match shader {
                        Some(_) => None,
                        None if to_hit_object => Some("the hit object stores it for later execution".into()),
                        None => Some(self.no_shader(&trace)),
                    };
                    ran = shader;
                    let sbt = &self.pipeline.sbt;
                    let records = if committed.is_some() { &sbt.hit } else { &sbt.miss };
                    let data = data_of(record.get(records).and_then(Option::as_ref));
                    trace.shader = shader.and_then(|_| self.next_shader(data)).map(Box::new);
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
    fn next_shader(&mut self, record: Option<Arc<Buffer>>) -> Option<ShaderRun> {
        let begins = self.events.peek().is_some_and(|event| matches!(event, Event::Enter { .. }));
        begins.then(|| self.shader(record))?
    }

    /// The type by which a trace's payload is shown: that of the caller's variable. For a ray from
    /// the host it is the type that the last shader declares, otherwise any declared type of that
    /// size.
    fn payload_type(
        &self,
        caller: Option<Caller>,
        ran: Option<ShaderIndex>,
        words: usize,
    ) -> Option<(&'a Program, TypeId)> {
        let programs = &self.pipeline.programs;
        if let Some(caller) = caller {
            let program = &*programs[caller.shader.index()];
            let variable = program.interface.iter().find(|registers| {
                registers.storage_class == storage::RAY_PAYLOAD && registers.first == caller.payload
            })?;
            return Some((program, variable.ty));
        }
        let incoming = |program: &'a Program| {
            program.interface_registers(storage::INCOMING_RAY_PAYLOAD).map(|registers| (program, registers))
        };
        let last = ran.and_then(|shader| incoming(&programs[shader.index()]));
        last.or_else(|| {
            let mut all = programs.iter().filter_map(|program| incoming(program));
            all.find(|(_, registers)| registers.count as usize == words)
        })
        .map(|(program, registers)| (program, registers.ty))
    }

    fn hit_record(
        &self,
        tlas: &Arc<Tlas>,
        candidate: &Candidate,
        sbt: [u32; 3],
        index: RecordIndex,
    ) -> RecordChoice {
        let instance = &tlas.instances()[candidate.instance as usize];
        let arithmetic = Arithmetic {
            instance_offset: instance.sbt_record_offset,
            geometry: candidate.geometry,
            stride: sbt[1] & 0xF,
            offset: sbt[0] & 0xF,
        };
        debug_assert_eq!(
            RecordIndex::of_hit(instance.sbt_record_offset, candidate.geometry, sbt[1], sbt[0]),
            index
        );
        let records = &self.pipeline.sbt.hit;
        let record = index.get(records).and_then(Option::as_ref);
        RecordChoice {
            table: "hit",
            index: index.0,
            arithmetic: Some(arithmetic),
            records: records.len(),
            name: self.names.hit_record(index),
            group: record.map(|record| record.group),
        }
    }

    fn miss_record(&self, index: RecordIndex) -> RecordChoice {
        let records = &self.pipeline.sbt.miss;
        let record = index.get(records).and_then(Option::as_ref);
        RecordChoice {
            table: "miss",
            index: index.0,
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
}

fn data_of(record: Option<&SbtRecord>) -> Option<Arc<Buffer>> {
    record?.data.clone()
}

/// The data of a record by the layout that a shader declares; `None` where it declares none.
fn record_data(program: &Program, data: &Buffer, names: &Names<'_>) -> Option<RecordData> {
    let layout = of_record(program)?;
    let given = data.size();
    let declared = declared_size(layout, given);
    let word = |at: u64| data.load(4 * at, 32).unwrap_or(0);
    let members = members(layout, declared, MAX_RECORD_MEMBERS).into_iter().map(|member| {
        let words: Vec<u32> = (member.offset / 4..member.end().div_ceil(4)).map(word).collect();
        let bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
        let value = (member.end() <= given).then(|| names.value(TypedValue::of_bytes(member.layout, &bytes)));
        RecordMember { member: member.path, byte: member.offset, value }
    });
    let behind = (declared.div_ceil(4)..given / 4).take(MAX_RECORD_MEMBERS).map(word);
    Some(RecordData { given, declared, members: members.collect(), behind: behind.collect() })
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
