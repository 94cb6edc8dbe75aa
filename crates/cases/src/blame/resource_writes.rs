//! Finds the invocation and the line that wrote a byte of a buffer, or a texel, last.

use std::sync::Arc;

use crate::blame::{Blame, last_write, request};
use crate::case::Loaded;
use crate::expect::Subject;
use crate::observe::fresh_resources;
use crate::run::trace;
use anyhit_base::count::grouped;
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::image::Image;
use anyhit_engine::machine::{
    Batch, Binding, Bindings, Buffer, Descriptor, Observer, OpIndex, Reg, Resources, ShaderIndex,
};
use anyhit_engine::ops::image::reader::LaneReader;
use anyhit_engine::ops::memory::{BufferRef, Chunk, access_location};
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::shared_access::SharedPart;
use anyhit_engine::pipeline::{Company, Event, Launch, PipelineObserver, RunOptions, SteppedDispatch};
use anyhit_engine::program::Program;
use anyhit_engine::reflect::lookup::{DataBlock, find_block};
use anyhit_explain::names;
use anyhit_explain::transcript::TranscriptLine;
use anyhit_scene::file::RayEntry;
use anyhit_scene::pass::{Pass, PassWork};
use anyhit_unit_test::memory;

/// Of larger launches and dispatches one invocation alone is searched.
const MAX_INVOCATIONS: u64 = 1 << 16;

/// How many lines are listed that could have written what nothing wrote.
const LINES: usize = 6;

/// Finds who wrote what a subject is about: in the launches and dispatches of the scene, or in one
/// ray.
pub(super) fn blame(loaded: &Loaded, subject: &Subject, ray: Option<usize>) -> Option<Blame> {
    let resources = fresh_resources(&loaded.assembled);
    let target = Target::of(subject, &resources)?;
    let mut search = Search::new(loaded, subject, &target);
    match ray {
        Some(ray) => search.ray(&loaded.scene.rays[ray], &resources)?,
        None => search.passes(&resources),
    }
    Some(search.finish(ray.is_some()))
}

/// What is searched for.
#[derive(Clone, Debug)]
enum Target {
    /// A byte of a buffer.
    Byte(Arc<Buffer>, u64),
    /// A texel of an image.
    Texel(Arc<Image>, usize),
}

impl Target {
    fn of(subject: &Subject, resources: &Resources) -> Option<Self> {
        let descriptor = |[set, binding, element]: [u32; 3]| {
            resources.descriptors.get(&Binding { set, binding })?.get(element as usize)
        };
        Some(match subject {
            Subject::Buffer(at, byte) => match descriptor(*at)? {
                Descriptor::Buffer(buffer) => Self::Byte(buffer.clone(), *byte as u64),
                _ => return None,
            },
            Subject::UnboundBuffer(name, byte) => {
                Self::Byte(resources.memory.named_buffer(name)?.1.clone(), *byte as u64)
            }
            Subject::Texel(at, [x, y]) => match descriptor(*at)? {
                Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => {
                    Self::Texel(image.clone(), *y as usize * image.shape().extent[0] as usize + *x as usize)
                }
                _ => return None,
            },
            _ => return None,
        })
    }

    fn value(&self) -> u128 {
        match self {
            Self::Byte(buffer, byte) => {
                buffer.load(*byte & !3, 32).or_else(|| buffer.load(*byte, 8)).map_or(0, u128::from)
            }
            Self::Texel(image, texel) => image.load(*texel),
        }
    }

    /// How far a store begins behind the target and ends before it: none of both where it covers
    /// the target; `None` for a store to other memory.
    fn reach(&self, stored: Stored<'_>) -> Option<Reach> {
        let (at, first, count) = match (self, stored) {
            (Self::Byte(target, byte), Stored::Bytes(buffer, first, count)) => {
                if target.memory_id() != buffer.memory_id() {
                    return None;
                }
                // Offsets are those of the target's descriptor.
                let first = (buffer.offset() + first).checked_sub(target.offset())?;
                (*byte, first, count)
            }
            (Self::Texel(target, texel), Stored::Texel(image, index)) => {
                if !std::ptr::eq(&raw const **target, image) {
                    return None;
                }
                (*texel as u64, index as u64, 1)
            }
            _ => return None,
        };
        let distance = first.saturating_sub(at).max((at + 1).saturating_sub(first + count));
        Some(Reach { first, last: first + count - 1, distance })
    }
}

/// What an operation has stored to.
#[derive(Clone, Copy)]
enum Stored<'a> {
    Bytes(&'a Buffer, u64, u64),
    Texel(&'a Image, usize),
}

/// The bytes or texels that a store covers, and how far they are from the target.
#[derive(Clone, Copy, Debug)]
struct Reach {
    first: u64,
    last: u64,
    distance: u64,
}

/// A write of the target.
#[derive(Clone, Debug)]
struct Write {
    pass: usize,
    id: [u32; 3],
    line: Option<TranscriptLine>,
    shader: String,
    was_unchanged: bool,
}

/// What one line has stored to the resource.
#[derive(Clone, Debug, Default)]
struct LineStores {
    /// How often it stored.
    count: u64,
    /// The first and the last byte or texel.
    range: Option<(u64, u64)>,
}

/// How far a store is from the target, and the invocation that stored.
type NearStore = (u64, [u32; 3]);

/// The search through a scene.
struct Search<'a> {
    loaded: &'a Loaded,
    subject: &'a Subject,
    target: &'a Target,
    last: Option<Write>,
    /// By line of the shaders that could write the resource: file, line and text, or the shader
    /// where it has no lines.
    lines: SortedMap<(String, u32, String), LineStores>,
    /// The pass that is likely to be meant to write, and its invocation nearest to that.
    likely: Option<(usize, Option<NearStore>)>,
    /// The pass that changed the value unobserved, and its invocations.
    unobserved: Option<(usize, u64)>,
}

impl<'a> Search<'a> {
    fn new(loaded: &'a Loaded, subject: &'a Subject, target: &'a Target) -> Self {
        Self { loaded, subject, target, last: None, lines: SortedMap::new(), likely: None, unobserved: None }
    }

    fn ray(&mut self, ray: &RayEntry, resources: &Resources) -> Option<()> {
        let single = self.loaded.assembled.single_launch(ray.pass().map(|key| key.value.0.as_str())).ok()?;
        single.run_before(resources).ok()?;
        let resources = single.resources(resources);
        let launch = Launch { pipeline: &single.pipeline, resources: &resources };
        let mut finder = WriteFinder::new(&single.pipeline.programs, self.target);
        let _ = trace(
            &self.loaded.scene,
            &launch,
            single.size_in(&resources),
            ray,
            &mut Silent,
            Some(&mut finder),
        );
        self.take(single.number, finder);
        Some(())
    }

    fn passes(&mut self, resources: &Resources) {
        let assembled = &self.loaded.assembled;
        for (number, pass) in assembled.passes.iter().enumerate() {
            let before = self.target.value();
            let count = self.invocations(pass, resources);
            let observed = match count <= MAX_INVOCATIONS && self.can_be_observed(pass) {
                true => self.observe(number, pass, resources),
                false => {
                    self.observe_one(number, pass, resources);
                    assembled.run_pass(pass, resources, RunOptions::default()).is_ok()
                }
            };
            let is_known = self.last.as_ref().is_some_and(|write| write.pass == number);
            if self.target.value() != before && !is_known {
                self.unobserved = Some((number, count));
                self.last = None;
            } else if is_known {
                self.unobserved = None;
            }
            if !observed {
                return;
            }
        }
    }

    fn size(&self, pass: &Pass, resources: &Resources) -> [u32; 3] {
        let resources = self.loaded.assembled.pass_resources(pass, resources);
        match &pass.work {
            PassWork::Launch(launch) => launch.size(&resources),
            PassWork::Dispatch(at) => {
                let dispatch = &self.loaded.assembled.dispatches[*at];
                let group = dispatch.compute.workgroup_size();
                let groups = dispatch.groups(&resources);
                anyhit_engine::math::array::from_fn(|axis| groups[axis].saturating_mul(group[axis]))
            }
        }
    }

    fn invocations(&self, pass: &Pass, resources: &Resources) -> u64 {
        self.size(pass, resources).iter().fold(1, |all: u64, &side| all.saturating_mul(side.into()))
    }

    /// Whether all invocations of a pass can run under an observer.
    fn can_be_observed(&self, pass: &Pass) -> bool {
        let assembled = &self.loaded.assembled;
        let subgroup = match &pass.work {
            PassWork::Launch(launch) => {
                let pipeline = assembled.pipeline_at(launch.pipeline);
                pipeline.uses_subgroups().then_some(pipeline.subgroup_size)
            }
            PassWork::Dispatch(at) => {
                let compute = &assembled.dispatches[*at].compute;
                compute.program.uses_subgroups.then_some(compute.subgroup_size)
            }
        };
        subgroup.is_none_or(|size| size <= 64)
    }

    /// Runs a pass under observation; `false` where it trapped.
    fn observe(&mut self, number: usize, pass: &Pass, resources: &Resources) -> bool {
        let assembled = &self.loaded.assembled;
        let resources = assembled.pass_resources(pass, resources);
        match &pass.work {
            PassWork::Launch(one) => {
                let pipeline = assembled.pass_pipeline(one);
                let mut finder = WriteFinder::new(&pipeline.programs, self.target);
                let launch = Launch { pipeline: &pipeline, resources: &resources };
                let ran = launch.run_observed(one.size(&resources), &mut Silent, &mut finder);
                self.take(number, finder);
                ran.is_ok()
            }
            PassWork::Dispatch(at) => {
                let dispatch = &assembled.dispatches[*at];
                let programs = [dispatch.compute.program.clone()];
                let mut finder = WriteFinder::new(&programs, self.target);
                let ran = dispatch.compute.run_observed(
                    &resources,
                    dispatch.groups(&resources),
                    &mut |_| (),
                    &mut finder,
                );
                self.take(number, finder);
                ran.is_ok()
            }
        }
    }

    /// Runs the one invocation of a large pass that is likely to write, on a copy of the resources.
    fn observe_one(&mut self, number: usize, pass: &Pass, resources: &Resources) -> Option<()> {
        let assembled = &self.loaded.assembled;
        let id = self.guess(number, resources)?;
        let copy = memory::copied(resources);
        let target = Target::of(self.subject, &copy)?;
        let resources = assembled.pass_resources(pass, &copy);
        match &pass.work {
            PassWork::Launch(one) => {
                let pipeline = assembled.pass_pipeline(one);
                let mut finder = WriteFinder::new(&pipeline.programs, &target);
                let launch = Launch { pipeline: &pipeline, resources: &resources };
                let _ = launch.run_one(id, one.size(&resources), Some(&mut Silent), Some(&mut finder));
                self.take(number, finder);
            }
            PassWork::Dispatch(at) => {
                let dispatch = &assembled.dispatches[*at];
                let programs = [dispatch.compute.program.clone()];
                let mut finder = WriteFinder::new(&programs, &target);
                let stepped = SteppedDispatch::<64>::new(
                    dispatch.compute.clone(),
                    &resources,
                    dispatch.groups(&resources),
                    id,
                    Company::Observed,
                );
                stepped.ok()?.resume(&mut finder, &mut |_| ());
                self.take(number, finder);
            }
        }
        Some(())
    }

    /// The invocation of a pass that is likely to be meant for the target: the one with the texel's
    /// coordinates, or with the number of the element of a runtime array.
    fn guess(&self, number: usize, resources: &Resources) -> Option<[u32; 3]> {
        let pass = &self.loaded.assembled.passes[number];
        let size = self.size(pass, resources);
        let inside = |id: [u32; 3]| id.iter().zip(size).all(|(&at, side)| at < side).then_some(id);
        match *self.subject {
            Subject::Texel(_, [x, y]) => inside([x, y, 0]),
            Subject::Buffer([set, binding, element], byte) => {
                let block = DataBlock::of_buffer(Binding { set, binding }, element);
                let mut programs = self.programs(pass);
                let layout = programs.find_map(|program| {
                    find_block(&program.module, block)
                        .ok()
                        .flatten()
                        .and_then(|layout| layout.runtime_stride())
                });
                let (start, stride) = layout?;
                let element = byte.checked_sub(start)?.checked_div(stride)? as u64;
                let [width, height, _] = size.map(|side| u64::from(side).max(1));
                let id = [element % width, element / width % height, element / width / height];
                inside(id.map(|axis| u32::try_from(axis).unwrap_or(u32::MAX)))
            }
            _ => None,
        }
    }

    fn programs(&self, pass: &Pass) -> impl Iterator<Item = &'a Arc<Program>> {
        let assembled = &self.loaded.assembled;
        match &pass.work {
            PassWork::Launch(launch) => assembled.pipeline_at(launch.pipeline).programs.iter(),
            PassWork::Dispatch(at) => std::slice::from_ref(&assembled.dispatches[*at].compute.program).iter(),
        }
    }

    /// Takes over what was found in a pass.
    fn take(&mut self, number: usize, finder: WriteFinder<'_>) {
        if let Some(found) = &finder.last {
            let program = &finder.programs[found.shader.index()];
            self.last = Some(Write {
                pass: number,
                id: found.id,
                line: names::source_line(program, found.op),
                shader: described(program),
                was_unchanged: found.was_unchanged,
            });
        }
        let mut writes_resource = finder.nearest.is_some();
        for (at, program) in finder.programs.iter().enumerate() {
            for (op, operation) in program.ops.iter().enumerate() {
                let stores = finder.stores.get(&(at, op));
                if stores.is_none() && !self.may_write(program, operation) {
                    continue;
                }
                writes_resource = true;
                let key = match names::source_line(program, OpIndex(op as u32)) {
                    Some(TranscriptLine { file, line, text }) => (file, line, text.unwrap_or_default()),
                    None => (described(program), 0, String::new()),
                };
                let line = self.lines.entry(key).or_default();
                if let Some(stores) = stores {
                    line.count += stores.count;
                    line.range = merged(line.range, stores.range);
                }
            }
        }
        if writes_resource {
            self.likely = Some((number, finder.nearest));
        }
    }

    /// Whether an operation stores to the resource's binding, as far as that is known before it
    /// runs.
    fn may_write(&self, program: &Program, op: &Op) -> bool {
        let at = match self.subject {
            Subject::Buffer([set, binding, _], _) | Subject::Texel([set, binding, _], _) => {
                Binding { set: *set, binding: *binding }
            }
            _ => return false,
        };
        let is_there = |handle: u32| {
            let slot = Bindings::slot_of(handle).and_then(|(slot, _)| program.slots.get(slot));
            slot.is_some_and(|slot| slot.binding == at)
        };
        let known = |register: Reg| program.constants.iter().find(|(known, _)| *known == register);
        match stored_to(op) {
            Some(SharedPart::Bytes(Chunk { buffer: BufferRef::Handle(handle), .. })) => is_there(*handle),
            Some(SharedPart::Texel(texel)) => known(texel.image).is_some_and(|(_, handle)| is_there(*handle)),
            _ => false,
        }
    }

    fn finish(self, is_ray: bool) -> Blame {
        if let Some(write) = &self.last {
            let note = last_write(write.line.as_ref(), &write.shader, write.was_unchanged);
            let request = (!is_ray).then(|| request(self.loaded, write.pass, write.id));
            return Blame { request, line: write.line.clone(), notes: vec![note] };
        }
        if let Some((pass, count)) = self.unobserved {
            let label = self.loaded.assembled.passes[pass].label(pass);
            let note = format!(
                "written in pass {label}, by one of its {} invocations: too many to search (the limit \
                 is {})",
                grouped(count),
                grouped(MAX_INVOCATIONS)
            );
            let request =
                self.guess(pass, &self.loaded.assembled.resources).map(|id| request(self.loaded, pass, id));
            return Blame { request, line: None, notes: vec![note] };
        }
        let (what, first, last) = match self.target {
            Target::Byte(..) => ("byte", "bytes", "to"),
            Target::Texel(..) => ("texel", "texels", "to"),
        };
        let mut notes = vec![match (self.lines.is_empty(), is_ray) {
            (true, true) => "never written: no shader of this ray stores to it".to_owned(),
            (true, false) => "never written: no shader of the scene stores to it".to_owned(),
            (false, _) => {
                format!("never written: no invocation stores to this {what}; the lines that store:")
            }
        }];
        let width = match self.target {
            Target::Texel(image, _) => Some(u64::from(image.shape().extent[0]).max(1)),
            Target::Byte(..) => None,
        };
        let place = |at: u64| match width {
            Some(width) => format!("({}, {})", at % width, at / width),
            None => at.to_string(),
        };
        for ((file, line, text), stores) in self.lines.iter().take(LINES) {
            let text = if text.is_empty() { String::new() } else { format!(": {text}") };
            let at = if *line == 0 { file.clone() } else { format!("{file}:{line}{text}") };
            let ran = match (stores.count, stores.range) {
                (0, _) | (_, None) => "never ran".to_owned(),
                (1, Some((from, to))) if from == to => format!("ran once, on {what} {}", place(from)),
                (1, Some((from, to))) => format!("ran once, on {first} {} {last} {}", place(from), place(to)),
                (count, Some((from, to))) => {
                    let count = grouped(count);
                    format!("ran {count} times, on {first} {} {last} {}", place(from), place(to))
                }
            };
            notes.push(format!("{at} ({ran})"));
        }
        if self.lines.len() > LINES {
            notes.push(format!("and {} more lines", grouped(self.lines.len() - LINES)));
        }
        let passes = &self.loaded.assembled.passes;
        let request = match self.likely {
            _ if is_ray || passes.is_empty() => None,
            Some((pass, nearest)) => {
                let id = self
                    .guess(pass, &self.loaded.assembled.resources)
                    .or(nearest.map(|(_, id)| id))
                    .unwrap_or_default();
                Some(request(self.loaded, pass, id))
            }
            None => {
                let pass = passes.len() - 1;
                Some(request(
                    self.loaded,
                    pass,
                    self.guess(pass, &self.loaded.assembled.resources).unwrap_or_default(),
                ))
            }
        };
        Blame { request, line: None, notes }
    }
}

fn described(program: &Program) -> String {
    format!("{} `{}`", program.stage.name(), program.name)
}

fn merged(one: Option<(u64, u64)>, other: Option<(u64, u64)>) -> Option<(u64, u64)> {
    match (one, other) {
        (Some((first, last)), Some((other_first, other_last))) => {
            Some((first.min(other_first), last.max(other_last)))
        }
        (one, other) => one.or(other),
    }
}

/// What an operation stores to.
fn stored_to(op: &Op) -> Option<SharedPart<'_>> {
    let mut found = None;
    op.shared_accesses(&mut |used, part| found = Some(part).filter(|_| used.stores()).or(found));
    found
}

/// A write of the target, in the pass that is observed.
#[derive(Clone, Copy, Debug)]
struct FoundWrite {
    shader: ShaderIndex,
    op: OpIndex,
    id: [u32; 3],
    was_unchanged: bool,
}

/// Observes the stores of a pass.
struct WriteFinder<'a> {
    programs: &'a [Arc<Program>],
    target: &'a Target,
    /// By shader: which operations store to memory.
    watched: Vec<Vec<bool>>,
    shader: ShaderIndex,
    /// The target's value after the last write.
    value: u128,
    last: Option<FoundWrite>,
    /// What each operation stored to the resource, by shader and operation.
    stores: SortedMap<(usize, usize), LineStores>,
    /// The nearest store: its distance and the invocation.
    nearest: Option<NearStore>,
}

impl<'a> WriteFinder<'a> {
    fn new(programs: &'a [Arc<Program>], target: &'a Target) -> Self {
        let watched = |program: &Arc<Program>| program.ops.iter().map(|op| stored_to(op).is_some()).collect();
        Self {
            programs,
            target,
            watched: programs.iter().map(watched).collect(),
            shader: ShaderIndex(0),
            value: target.value(),
            last: None,
            stores: SortedMap::new(),
            nearest: None,
        }
    }

    fn note(&mut self, op: OpIndex, id: [u32; 3], reach: Reach) {
        let stores = self.stores.entry((self.shader.index(), op.index())).or_default();
        stores.count += 1;
        stores.range = merged(stores.range, Some((reach.first, reach.last)));
        if self.nearest.is_none_or(|(distance, _)| reach.distance < distance) {
            self.nearest = Some((reach.distance, id));
        }
        if reach.distance == 0 {
            let value = self.target.value();
            let was_unchanged = value == self.value;
            self.value = value;
            self.last = Some(FoundWrite { shader: self.shader, op, id, was_unchanged });
        }
    }
}

impl<const W: usize> Observer<W> for WriteFinder<'_> {
    fn resumed(&mut self, shader: ShaderIndex, _: &mut Batch<W>) {
        self.shader = shader;
    }

    fn after(&mut self, batch: &mut Batch<W>, bindings: &Bindings, op: OpIndex) {
        let watched = self.watched.get(self.shader.index()).and_then(|ops| ops.get(op.index()));
        if watched != Some(&true) {
            return;
        }
        let program = &self.programs[self.shader.index()];
        let Some(store) = stored_to(&program.ops[op.index()]) else { return };
        for lane in batch.mask.lanes() {
            let reach = match &store {
                SharedPart::Bytes(chunk) => {
                    let at = access_location(batch, lane, bindings, chunk);
                    let bytes = u64::from(chunk.width / 8 * chunk.count);
                    at.and_then(|(buffer, first)| self.target.reach(Stored::Bytes(buffer, first, bytes)))
                }
                SharedPart::Texel(texel) => {
                    let reader = LaneReader::new(&batch.registers, lane, bindings);
                    let at = texel.resolve(reader).ok();
                    at.and_then(|(image, index)| self.target.reach(Stored::Texel(image, index)))
                }
                // No operation stores through a sampler.
                SharedPart::Texels { .. } => None,
            };
            if let Some(reach) = reach {
                self.note(op, batch.invocations.launch_id(lane), reach);
            }
        }
    }
}

/// Receives events, under which every shader runs, and forgets them.
struct Silent;

impl PipelineObserver for Silent {
    fn observes_queries(&self) -> bool {
        false
    }

    fn observes_traversal(&self) -> bool {
        false
    }

    fn event(&mut self, _: Event) {}
}
