//! Cases: scenes with expectations, found in folders and run at several widths.

use std::path::{Path, PathBuf};

use crate::accel::{RayFlags, TraceRay};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::geometry::Ray;
use crate::harness::expect::{Bytes, Expectations, Observed};
use crate::harness::memory;
use crate::machine::Descriptor;
use crate::ops::row::{Row, Width};
use crate::pipeline::{Event, Launch, RayOperands};
use crate::scene::file::{GivenRay, RayEntry, SceneFile};
use crate::scene::read::Report;
use crate::scene::{Assembled, DiskFiles, Files, Options, ResolvedScene, assemble, load};

/// A scene, or one of its variants, that is to meet its `[expect]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// The scene file.
    pub scene: PathBuf,
    /// The variant: its place in the list and its name.
    pub variant: Option<(usize, String)>,
    /// The size of the launch, where it is not the scene's.
    pub size: Option<[u32; 2]>,
}

/// What running a case at one width left behind.
#[derive(Clone, Debug)]
pub struct Run {
    /// Everything that expectations look at.
    pub observed: Observed,
    /// The modules that were loaded.
    pub modules: Vec<PathBuf>,
}

/// The cases beneath a folder, in the order of their paths: every `scene.toml` with its variants.
///
/// # Errors
/// `Io` where a folder cannot be read, and the mistakes of scene files that are no TOML.
pub fn discover(folder: &Path) -> Result<Vec<Case>> {
    let mut scenes = Vec::new();
    collect(folder, &mut scenes)?;
    scenes.sort();
    let mut cases = Vec::new();
    for scene in scenes {
        cases.extend(Case::of(&scene)?);
    }
    Ok(cases)
}

fn collect(folder: &Path, scenes: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(folder).map_err(|error| Error::io(folder, error))?;
    for entry in entries {
        let entry = entry.map_err(|error| Error::io(folder, error))?;
        let kind = entry.file_type().map_err(|error| Error::io(entry.path(), error))?;
        if kind.is_dir() {
            collect(&entry.path(), scenes)?;
        } else if entry.file_name() == "scene.toml" {
            scenes.push(entry.path());
        }
    }
    Ok(())
}

impl Case {
    /// The cases of one scene file: itself, then its variants.
    ///
    /// # Errors
    /// `Io` where the file cannot be read, `InvalidScene` where it is no scene.
    pub fn of(scene: &Path) -> Result<Vec<Self>> {
        let text = String::from_utf8_lossy(&DiskFiles.read(scene)?).into_owned();
        // Other mistakes than of syntax are told when the case is run.
        let report = Report::default();
        let file = SceneFile::parse(scene, &text, &report)?;
        let variants = file.variants.into_iter().enumerate();
        let variants = variants.map(|(at, variant)| Some((at, variant.name.value)));
        let case = |variant| Self { scene: scene.to_path_buf(), variant, size: None };
        Ok(std::iter::once(None).chain(variants).map(case).collect())
    }

    /// The scene's path beneath `root`, and the variant: `shaders/pass/arithmetic/basics (O0)`.
    pub fn name(&self, root: &Path) -> String {
        let folder = self.scene.parent().filter(|_| self.scene.ends_with("scene.toml"));
        let path = folder.map_or_else(|| self.scene.with_extension(""), Path::to_path_buf);
        let path = path.strip_prefix(root).unwrap_or(&path).display().to_string().replace('\\', "/");
        match &self.variant {
            Some((_, variant)) => format!("{path} ({variant})"),
            None => path,
        }
    }

    /// Loads the scene, runs it at 1, 8 and 32 lanes, and compares: the widths with each other bit
    /// for bit, then the result with `[expect]`. Gives the run at 32 lanes.
    ///
    /// # Errors
    /// The mistakes of scene and shaders; `Expectation` for each difference.
    pub fn check(&self) -> Result<Run> {
        let (scene, assembled) = self.load()?;
        let expectations = Expectations::read(&scene.document)?;
        let one = run::<1>(&scene, &assembled);
        let many = run::<32>(&scene, &assembled);
        for (lanes, other) in [(8, &run::<8>(&scene, &assembled)), (32, &many)] {
            if let Some(difference) = difference(&one, other) {
                let message = format!("1 and {lanes} lanes disagree: {difference}");
                return Err(Error::new(ErrorKind::Expectation, message)
                    .at(Place::File(self.scene.clone()))
                    .note("results must not depend on how many invocations run side by side"));
            }
        }
        expectations.check(&many)?;
        let modules = scene.shaders.iter().map(|module| module.path.clone()).collect();
        Ok(Run { observed: many, modules })
    }

    fn load(&self) -> Result<(ResolvedScene, Assembled)> {
        let variant = self.variant.as_ref().map(|(at, _)| *at);
        let scene = load(&self.scene, &DiskFiles, &Options { size: self.size, variant })?;
        let assembled = assemble(&scene)?;
        Ok((scene, assembled))
    }
}

/// Launches a scene on a copy of its resources, and traces its rays.
pub fn run<const W: usize>(scene: &ResolvedScene, assembled: &Assembled) -> Observed
where
    Row: Width<W>,
{
    let resources = memory::copied(&assembled.resources);
    let mut observed = Observed::default();
    if assembled.pipeline.sbt.ray_generation.is_some() || !assembled.dispatches.is_empty() {
        match assembled.run::<W>(&resources, &|_| ()) {
            Ok(stats) => observed.stats = Some(stats),
            Err(trap) => observed.trap = Some(trap),
        }
    }
    for binding in &scene.resources {
        let key = crate::machine::Binding { set: binding.set, binding: binding.binding };
        let found = resources.descriptors.get(&key).and_then(|list| list.get(binding.element as usize));
        let bytes = |row, bytes| Bytes {
            name: binding.name.clone(),
            binding: [binding.set, binding.binding, binding.element],
            row,
            bytes,
        };
        match found {
            Some(Descriptor::Buffer(buffer)) => observed.buffers.push(bytes(None, buffer.bytes())),
            Some(Descriptor::Image(image) | Descriptor::ImageSampler(image, _)) => {
                let row = [image.shape().extent[0] as usize, image.format().texel_size() as usize];
                observed.images.push(bytes(Some(row), image.bytes()));
            }
            _ => {}
        }
    }
    for ray in &scene.rays {
        // What a ray's shaders write must not be seen by the expectations of buffers.
        let resources = memory::copied(&assembled.resources);
        let launch = Launch { pipeline: &assembled.pipeline, resources: &resources };
        observed.rays.push(trace(scene, &launch, assembled.size, ray));
    }
    observed
}

type Traced = (Option<String>, Result<Option<crate::accel::Committed>>);

fn trace(scene: &ResolvedScene, launch: &Launch<'_>, size: [u32; 3], ray: &RayEntry) -> Traced {
    match ray {
        RayEntry::Pixel { name, pixel } => {
            let mut events: Vec<Event> = Vec::new();
            let id = [pixel.value[0], pixel.value[1], 0];
            let run = launch.run_one(id, size, &mut events, &mut ());
            // Traversal ends before a closest-hit shader traces on: the first to end is the ray.
            let committed = events.iter().find_map(|event| match event {
                Event::Traversed { committed, .. } => Some(*committed),
                _ => None,
            });
            (name.clone(), run.map(|_| committed.flatten()))
        }
        RayEntry::Given(given) => {
            let Some((_, tlas)) = scene.tlas.first() else {
                let message = "a ray needs a scene with instances";
                return (given.name.clone(), Err(Error::new(ErrorKind::InvalidScene, message)));
            };
            let outcome = launch.trace(tlas, operands(launch, given), &mut ());
            (given.name.clone(), outcome.map(|outcome| outcome.committed))
        }
    }
}

/// The operands of a given ray, with a payload of zeros that is large enough for every shader.
fn operands(launch: &Launch<'_>, ray: &GivenRay) -> RayOperands {
    RayOperands {
        trace: TraceRay {
            ray: Ray { origin: ray.origin, direction: ray.direction, t_min: ray.t_min, t_max: ray.t_max },
            flags: RayFlags(ray.flags),
            cull_mask: ray.cull_mask,
        },
        sbt_offset: ray.sbt_offset,
        sbt_stride: ray.sbt_stride,
        miss_index: ray.miss_index,
        payload: vec![0; memory::payload_words(launch.pipeline)],
    }
}

/// What differs between two runs of one case.
fn difference(one: &Observed, other: &Observed) -> Option<String> {
    let trap = |observed: &Observed| observed.trap.as_ref().map(Error::render);
    if trap(one) != trap(other) {
        let words = |trap: Option<String>| trap.unwrap_or_else(|| "no trap".into());
        return Some(format!("{} / {}", words(trap(one)), words(trap(other))));
    }
    let memory =
        |observed: &Observed| observed.buffers.iter().chain(&observed.images).cloned().collect::<Vec<_>>();
    for (one, other) in memory(one).iter().zip(&memory(other)) {
        if let Some(at) = one.bytes.iter().zip(&other.bytes).position(|(one, other)| one != other) {
            let word = |bytes: &[u8]| {
                let word = bytes.get(at & !3..(at & !3) + 4).and_then(|word| word.try_into().ok());
                word.map_or(0, u32::from_le_bytes)
            };
            let (one_word, other_word) = (word(&one.bytes), word(&other.bytes));
            return Some(format!(
                "`{}` at byte {}: {one_word:#010x} / {other_word:#010x} (as floats {} / {})",
                one.name,
                at & !3,
                f32::from_bits(one_word),
                f32::from_bits(other_word)
            ));
        }
    }
    // Batches differ with the width, invocations do not.
    let counts = |observed: &Observed| {
        let stats = observed.stats.as_ref()?;
        Some((
            stats.rays,
            stats.ray_queries,
            stats.reorders,
            stats.shaders.values().map(|stage| stage.invocations).collect::<Vec<_>>(),
        ))
    };
    (counts(one) != counts(other)).then(|| format!("counts {:?} / {:?}", counts(one), counts(other)))
}
