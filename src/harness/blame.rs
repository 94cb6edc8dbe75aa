//! Finds the source line that wrote a wrong number: runs again and observes the writes of one word.

use std::sync::Arc;

use crate::debug::names;
use crate::debug::transcript::TranscriptLine;
use crate::harness::case::Loaded;
use crate::harness::expect::Subject;
use crate::harness::observe::fresh_resources;
use crate::harness::run::trace;
use crate::machine::image::Image;
use crate::machine::{Batch, Binding, Buffer, Descriptor, Observer, OpIndex, Reg, Resources, ShaderIndex};
use crate::ops::pointer::storage;
use crate::pipeline::{Launch, Pipeline};
use crate::scene::file::RayEntry;

/// Launches of more invocations are not searched for the one that wrote.
const INVOCATIONS: u64 = 4096;

/// The invocation and the source line that wrote a number.
#[derive(Clone, Debug)]
pub struct Writer {
    /// The pass and its invocation of ray generation, where launches were looked at.
    pub invocation: Option<(usize, [u32; 3])>,
    /// The line.
    pub line: Option<TranscriptLine>,
}

impl Writer {
    /// Where it is, as a note of an error.
    pub fn note(&self) -> Option<String> {
        let line = self.line.as_ref()?;
        let text = line.text.as_ref().map_or_else(String::new, |text| format!(": {text}"));
        Some(format!("last written at {}:{}{text}", line.file, line.line))
    }
}

/// Finds who wrote the word that a difference is about; `ray` is the place of the ray that was
/// tested by itself.
pub fn writer(loaded: &Loaded, subject: &Subject, ray: Option<usize>) -> Option<Writer> {
    let resources = fresh_resources(&loaded.assembled.resources);
    let target = match subject {
        Subject::Payload(word) | Subject::Ray(_, Some(word)) => Target::Payload(*word as u32),
        Subject::Buffer(at, byte) => match descriptor(&resources, *at)? {
            Descriptor::Buffer(buffer) => Target::Buffer(buffer.clone(), *byte as u64 & !3),
            _ => return None,
        },
        Subject::UnboundBuffer(name, byte) => {
            Target::Buffer(resources.memory.named_buffer(name)?.1.clone(), *byte as u64 & !3)
        }
        Subject::Texel(at, [x, y]) => match descriptor(&resources, *at)? {
            Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => {
                let texel = *y as usize * image.shape().extent[0] as usize + *x as usize;
                Target::Image(image.clone(), texel)
            }
            _ => return None,
        },
        _ => return None,
    };
    let named = |name: &String| loaded.scene.rays.iter().position(|ray| ray.name() == Some(name));
    let ray = match subject {
        Subject::Ray(name, _) => Some(named(name)?),
        _ => ray,
    };
    match ray {
        Some(ray) => writer_of_ray(loaded, &loaded.scene.rays[ray], &resources, target),
        None => writer_of_launches(loaded, &resources, &target),
    }
}

fn writer_of_ray(loaded: &Loaded, ray: &RayEntry, resources: &Resources, target: Target) -> Option<Writer> {
    let single = loaded.assembled.single_launch(ray.pass().map(|key| key.value.0.as_str())).ok()?;
    single.run_before(resources).ok()?;
    let resources = single.resources(resources);
    let launch = Launch { pipeline: &single.pipeline, resources: &resources };
    let mut finder = WriteFinder::new(&single.pipeline, target);
    let _ = trace(&loaded.scene, &launch, single.size, ray, &mut |_| (), Some(&mut finder));
    Some(Writer { invocation: None, line: finder.line() })
}

/// Runs the passes up to the last launch; `None` where no launch wrote, or one cannot be searched.
fn writer_of_launches(loaded: &Loaded, resources: &Resources, target: &Target) -> Option<Writer> {
    let assembled = &loaded.assembled;
    let last = assembled.passes.iter().rposition(|pass| pass.launch().is_some())?;
    let mut found = None;
    for (number, pass) in assembled.passes[..=last].iter().enumerate() {
        let Some(one) = pass.launch() else {
            assembled.run_pass::<64>(pass, resources, &|_| ()).ok()?;
            continue;
        };
        let [width, height, depth] = one.size;
        let pipeline = assembled.pass_pipeline(one);
        let count = u64::from(width) * u64::from(height) * u64::from(depth);
        if pipeline.uses_subgroups() || count > INVOCATIONS {
            return None;
        }
        let resources = assembled.pass_resources(pass, resources);
        let launch = Launch { pipeline: &pipeline, resources: &resources };
        let mut finder = WriteFinder::new(&pipeline, target.clone());
        for index in 0..width * height * depth {
            let id = [index % width, index / width % height, index / width / height];
            let before = finder.writes;
            // Under a receiver of events every shader runs.
            let run = launch.run_one(id, one.size, Some(&mut |_| ()), Some(&mut finder));
            if finder.writes > before {
                found = Some(Writer { invocation: Some((number, id)), line: finder.line() });
            }
            if run.is_err() {
                return found;
            }
        }
    }
    found
}

fn descriptor(resources: &Resources, [set, binding, element]: [u32; 3]) -> Option<&Descriptor> {
    resources.descriptors.get(&Binding { set, binding })?.get(element as usize)
}

/// The memory whose writes are searched.
#[derive(Clone)]
enum Target {
    /// A word of the payload of the first ray.
    Payload(u32),
    Buffer(Arc<Buffer>, u64),
    Image(Arc<Image>, usize),
}

/// Compares before each operation what the one before has left.
struct WriteFinder<'a> {
    pipeline: &'a Pipeline,
    target: Target,
    shader: ShaderIndex,
    last: Option<u128>,
    op: OpIndex,
    writes: u64,
    /// Shader and operation of the last write.
    written: Option<(ShaderIndex, OpIndex)>,
}

impl<'a> WriteFinder<'a> {
    fn new(pipeline: &'a Pipeline, target: Target) -> Self {
        Self {
            pipeline,
            target,
            shader: ShaderIndex(0),
            last: None,
            op: OpIndex(0),
            writes: 0,
            written: None,
        }
    }

    fn value(&self, batch: &Batch<1>) -> Option<u128> {
        match &self.target {
            Target::Payload(word) => {
                // The shaders of the ray itself stand at depth 1, those of rays that they trace
                // deeper.
                let program = &self.pipeline.programs[self.shader.index()];
                let registers = program.interface_registers(storage::INCOMING_RAY_PAYLOAD);
                let registers =
                    registers.filter(|registers| *word < registers.count && batch.invocations.depth == 1)?;
                Some(u128::from(batch.registers[Reg(registers.first.0 + word)].0[0]))
            }
            Target::Buffer(buffer, byte) => buffer.load(*byte, 32).map(u128::from),
            Target::Image(image, texel) => Some(image.load(*texel)),
        }
    }

    fn look(&mut self, batch: &Batch<1>) {
        let value = self.value(batch);
        if value != self.last && value.is_some() {
            self.writes += 1;
            self.written = Some((self.shader, self.op));
            self.last = value;
        }
    }

    fn line(&self) -> Option<TranscriptLine> {
        let (shader, op) = self.written?;
        names::source_line(&self.pipeline.programs[shader.index()], op)
    }
}

impl Observer<1> for WriteFinder<'_> {
    fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<1>) {
        self.shader = shader;
        self.op = batch.op;
        self.last = self.value(batch);
    }

    fn before(&mut self, batch: &mut Batch<1>, op: OpIndex) -> bool {
        self.look(batch);
        self.op = op;
        false
    }

    fn stopped(&mut self, _: ShaderIndex, batch: &Batch<1>) {
        self.look(batch);
    }
}
