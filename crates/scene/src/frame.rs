//! The passes of an assembled scene, run in order on the same memory, and single launches of it.

use std::borrow::Cow;
use std::sync::Arc;

use crate::assemble::Assembled;
use crate::indirect::{indirect_size, size_buffer};
use crate::pass::{Dispatch, LaunchPass, OWN_SET, OwnBinding, Pass, PassWork};
use crate::pass_entry::{MAX_LAUNCH, PassKey};
use crate::resolved::{IndirectSize, Rebinding, RebindingSource};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::machine::{Binding, Descriptor, Resources};
use anyhit_engine::pipeline::{Launch, Pipeline, RunOptions, Stats, WrittenMemory};
use anyhit_engine::program::Program;

/// The descriptor that a pass finds. A sampler beside an image is the descriptor's own.
///
/// `own` are the resources as the pass finds them without it, `all` those of the scene.
fn rebound(rebinding: &Rebinding, own: &Resources, all: &Resources) -> Option<Descriptor> {
    let source = match &rebinding.source {
        RebindingSource::Bound(at) => descriptor(all, *at)?.clone(),
        RebindingSource::Unbound(name) => Descriptor::Buffer(all.memory.named_buffer(name)?.1.clone()),
    };
    Some(match (descriptor(own, rebinding.at), source) {
        (
            Some(Descriptor::ImageSampler(_, sampler)),
            Descriptor::Image(image) | Descriptor::ImageSampler(image, _),
        ) => Descriptor::ImageSampler(image, sampler.clone()),
        (_, Descriptor::ImageSampler(image, _)) => Descriptor::Image(image),
        (_, other) => other,
    })
}

fn descriptor(resources: &Resources, [set, binding, element]: [u32; 3]) -> Option<&Descriptor> {
    resources.descriptors.get(&Binding { set, binding })?.get(element as usize)
}

impl Assembled {
    /// The pipelines: `[pipeline]`, then the named ones, each with its index.
    pub fn all_pipelines(&self) -> impl Iterator<Item = (Option<usize>, &Pipeline)> {
        let named = self.pipelines.iter().enumerate().map(|(at, pipeline)| (Some(at), pipeline));
        std::iter::once((None, &self.pipeline)).chain(named)
    }

    /// The pipeline with an index among the named ones, or `[pipeline]`.
    pub fn pipeline_at(&self, index: Option<usize>) -> &Pipeline {
        index.map_or(&self.pipeline, |index| &self.pipelines[index])
    }

    /// All programs: those of the pipelines in their order, then those of the dispatches.
    pub fn programs(&self) -> impl Iterator<Item = &Arc<Program>> {
        let pipelines = self.all_pipelines().flat_map(|(_, pipeline)| &pipeline.programs);
        pipelines.chain(self.dispatches.iter().map(|dispatch| &dispatch.compute.program))
    }

    /// The index of the first program of a pipeline in [`Assembled::programs`].
    pub fn first_program(&self, pipeline: Option<usize>) -> usize {
        let before = self.all_pipelines().take(pipeline.map_or(0, |index| index + 1));
        before.map(|(_, pipeline)| pipeline.programs.len()).sum()
    }

    /// The index of a dispatch's program in [`Assembled::programs`].
    pub fn dispatch_program(&self, dispatch: usize) -> usize {
        self.all_pipelines().map(|(_, pipeline)| pipeline.programs.len()).sum::<usize>() + dispatch
    }

    /// The index of the first program of a pass in [`Assembled::programs`].
    pub fn first_program_of(&self, pass: &Pass) -> usize {
        match &pass.work {
            PassWork::Launch(launch) => self.first_program(launch.pipeline),
            PassWork::Dispatch(index) => self.dispatch_program(*index),
        }
    }

    /// Whether it is more than one launch of the pipeline, or a launch that is not its first, or
    /// finds bindings of its own.
    pub fn is_frame(&self) -> bool {
        let plain = |pass: &Pass| {
            let is_first = |launch: &LaunchPass| launch.record.is_none() && launch.pipeline.is_none();
            pass.launch().is_none_or(is_first) && pass.own_bindings.is_empty()
        };
        !self.passes.iter().all(plain)
    }

    /// True if the scene runs one launch of its pipeline's first ray generation shader, and nothing
    /// else; a scene that runs nothing counts, too.
    pub fn is_single_launch(&self) -> bool {
        self.passes.len() <= 1 && self.passes.iter().all(|pass| pass.launch().is_some()) && !self.is_frame()
    }

    /// The pipeline of a launch, with the record that is launched.
    pub fn pass_pipeline(&self, launch: &LaunchPass) -> Cow<'_, Pipeline> {
        let pipeline = self.pipeline_at(launch.pipeline);
        let Some(record) = &launch.record else { return Cow::Borrowed(pipeline) };
        let mut own = pipeline.clone();
        own.sbt.ray_generation = Some(record.clone());
        // What a buffer holds has the limit of what a scene gives.
        own.max_invocations = own.max_invocations.min(MAX_LAUNCH);
        Cow::Owned(own)
    }

    /// These resources as a pass finds them: with its push constants, with its own bindings, and
    /// with other contents in some descriptors.
    pub fn pass_resources<'r>(&self, pass: &Pass, resources: &'r Resources) -> Cow<'r, Resources> {
        let push_constants = match &pass.work {
            PassWork::Launch(launch) => &launch.push_constants,
            PassWork::Dispatch(index) => &self.dispatches[*index].push_constants,
        };
        let is_kept_apart = |at: &Binding| at.set == OWN_SET;
        let keeps_others = resources.descriptors.keys().any(is_kept_apart);
        if push_constants.is_none() && pass.rebindings.is_empty() && pass.indirect.is_none() && !keeps_others
        {
            return Cow::Borrowed(resources);
        }
        let mut own = resources.clone();
        own.push_constants = push_constants.clone().or(own.push_constants);
        for OwnBinding { at, kept } in &pass.own_bindings {
            own.descriptors.insert(*at, resources.descriptors.get(kept).cloned().unwrap_or_default());
            own.names.extend(resources.names.get(kept).map(|name| (*at, name.clone())));
        }
        own.indirect = pass.indirect.as_ref().and_then(|indirect| size_buffer(indirect, resources));
        if keeps_others {
            own.descriptors.retain(|at, _| !is_kept_apart(at));
        }
        for rebinding in &pass.rebindings {
            if let Some(descriptor) = rebound(rebinding, &own, resources) {
                let [set, binding, element] = rebinding.at;
                own.insert(Binding { set, binding }, element, descriptor);
            }
        }
        Cow::Owned(own)
    }

    /// The memory of these resources that passes and rays of the scene may write.
    pub fn written_memory(&self, resources: &Resources) -> WrittenMemory {
        let mut written = WrittenMemory::of(self.programs(), resources);
        for pass in &self.passes {
            written.add(self.pass_programs(pass), &self.pass_resources(pass, resources));
        }
        written
    }

    /// The programs of a pass.
    pub fn pass_programs(&self, pass: &Pass) -> &[Arc<Program>] {
        match &pass.work {
            PassWork::Launch(launch) => &self.pipeline_at(launch.pipeline).programs,
            PassWork::Dispatch(index) => std::slice::from_ref(&self.dispatches[*index].compute.program),
        }
    }

    /// The programs that find the descriptors that are kept at a set and binding, each with where
    /// it declares them: in the order of the passes, then all others.
    pub fn readers_of(&self, kept: Binding) -> Vec<(&Arc<Program>, Binding)> {
        let mut readers: Vec<(&Arc<Program>, Binding)> = Vec::new();
        let mut ran: Vec<*const Program> = Vec::new();
        for pass in &self.passes {
            let own = pass.own_bindings.iter().find(|own| own.kept == kept).map(|own| own.at);
            let at = own.or(Some(kept).filter(|kept| pass.kept(*kept) == *kept));
            for program in self.pass_programs(pass) {
                ran.push(Arc::as_ptr(program));
                let is_known = |at: &Binding| {
                    readers.iter().any(|(known, known_at)| Arc::ptr_eq(known, program) && known_at == at)
                };
                readers.extend(at.filter(|at| !is_known(at)).map(|at| (program, at)));
            }
        }
        let others = self.programs().filter(|program| !ran.contains(&Arc::as_ptr(program)));
        readers.extend(others.map(|program| (program, kept)));
        readers
    }

    /// How many invocations [`Assembled::run`] runs, shaders that they call not counted; of more
    /// than 2^64 the greatest number. A size that a buffer holds counts as 1.
    pub fn invocations(&self) -> u64 {
        let count = |sides: [u32; 3]| sides.iter().fold(1, |all: u64, &side| all.saturating_mul(side.into()));
        let dispatch =
            |one: &Dispatch| count(one.given_groups).saturating_mul(count(one.compute.workgroup_size()));
        let pass = |pass: &Pass| match &pass.work {
            PassWork::Launch(launch) => count(launch.given_size),
            PassWork::Dispatch(index) => dispatch(&self.dispatches[*index]),
        };
        self.passes.iter().map(pass).fold(0, u64::saturating_add)
    }

    /// Runs the passes of the scene on these resources.
    ///
    /// # Errors
    /// The first trap, as [`Launch::run`] and
    /// [`Compute::run`](anyhit_engine::pipeline::Compute::run) report it.
    pub fn run(&self, resources: &Resources, options: RunOptions<'_>) -> Result<Stats> {
        let mut stats = Stats::default();
        for (number, pass) in self.passes.iter().enumerate() {
            let more = self.run_pass(pass, resources, options);
            stats = stats.plus(&more.map_err(|error| self.in_pass(number, error))?);
        }
        Ok(stats)
    }

    /// An error of a pass, which says in which one of a frame it is, and where its size came from
    /// if that was too large.
    pub fn in_pass(&self, number: usize, error: Error) -> Error {
        let error = match &self.passes[number].indirect {
            Some(IndirectSize { buffer, offset, place, .. })
                if error.kind() == ErrorKind::InvalidArgument =>
            {
                error.note(format!("the size was read at offset {offset} of `{buffer}`")).at(place.clone())
            }
            _ => error,
        };
        match self.is_frame() {
            true => error.note(format!("in pass {} of the scene", self.passes[number].label(number))),
            false => error,
        }
    }

    /// Runs one of its passes.
    ///
    /// # Errors
    /// As [`Assembled::run`].
    pub fn run_pass(&self, pass: &Pass, resources: &Resources, options: RunOptions<'_>) -> Result<Stats> {
        let resources = self.pass_resources(pass, resources);
        match &pass.work {
            PassWork::Launch(launch) => {
                let pipeline = self.pass_pipeline(launch);
                Launch { pipeline: &pipeline, resources: &resources }.run(launch.size(&resources), options)
            }
            PassWork::Dispatch(index) => {
                let dispatch = &self.dispatches[*index];
                dispatch.compute.run(&resources, dispatch.groups(&resources), options)
            }
        }
    }

    /// Runs the passes before one of them, so that buffers and images hold what it finds in a
    /// frame. What they print is forgotten.
    ///
    /// # Errors
    /// As [`Assembled::run`].
    pub fn run_before(&self, number: usize, resources: &Resources) -> Result<()> {
        for pass in &self.passes[..number] {
            self.run_pass(pass, resources, RunOptions::default())?;
        }
        if let Some(printed) = resources.printed.as_ref().filter(|_| number > 0) {
            printed.take();
        }
        Ok(())
    }

    /// The number of the pass that a name or number means.
    ///
    /// # Errors
    /// `InvalidArgument` where there is no such pass.
    pub fn pass_number(&self, key: &str) -> Result<usize> {
        let names = || self.passes.iter().map(|pass| pass.name.as_deref());
        PassKey(key.to_owned()).find(names()).ok_or_else(|| {
            let message = format!("the scene has no pass `{key}`");
            Error::new(ErrorKind::InvalidArgument, message).note(PassKey::known(names()))
        })
    }

    /// The pass that is looked at: that of a name or number, else the first launch, else the first
    /// dispatch of a scene without launches.
    ///
    /// # Errors
    /// `InvalidArgument` where there is no such pass.
    pub fn single_pass(&self, key: Option<&str>) -> Result<SinglePass<'_>> {
        let number = match key {
            Some(key) => Some(self.pass_number(key)?),
            None if self.passes.iter().any(|pass| pass.launch().is_some()) => None,
            None => (!self.passes.is_empty()).then_some(0),
        };
        if let Some(number) = number
            && let pass = &self.passes[number]
            && let PassWork::Dispatch(index) = pass.work
        {
            let dispatch = &self.dispatches[index];
            return Ok(SinglePass::Dispatch(SingleDispatch { number, pass, index, dispatch }));
        }
        self.single_launch(key).map(|launch| SinglePass::Launch(Box::new(launch)))
    }

    /// The launch in which single rays and invocations run: that of a pass, by its name or number,
    /// or the first one. A scene without launches has its pipeline for rays from the host.
    ///
    /// # Errors
    /// `InvalidArgument` where there is no such pass, or it is a dispatch.
    pub fn single_launch(&self, key: Option<&str>) -> Result<SingleLaunch<'_>> {
        let at = match key {
            Some(key) => Some(self.pass_number(key)?),
            None => self.passes.iter().position(|pass| pass.launch().is_some()),
        };
        let (pass, number) = match at {
            Some(at) => (Cow::Borrowed(&self.passes[at]), at),
            None => {
                let size = self.size;
                let launch =
                    LaunchPass { pipeline: None, record: None, given_size: size, push_constants: None };
                let work = PassWork::Launch(launch);
                let (own_bindings, rebindings) = (Vec::new(), Vec::new());
                (Cow::Owned(Pass { name: None, own_bindings, rebindings, indirect: None, work }), 0)
            }
        };
        let Some(launch) = pass.launch() else {
            let message =
                format!("pass {} is a dispatch of a compute shader, not a launch", pass.label(number));
            return Err(Error::new(ErrorKind::InvalidArgument, message)
                .note("select an invocation of a dispatch with `--invocation X,Y,Z`"));
        };
        let (pipeline, index, size) = (self.pass_pipeline(launch), launch.pipeline, launch.given_size);
        Ok(SingleLaunch { assembled: self, number, pass, pipeline, index, size })
    }
}

/// A pass of a scene that is looked at.
#[derive(Clone, Debug)]
pub enum SinglePass<'a> {
    /// A launch.
    Launch(Box<SingleLaunch<'a>>),
    /// A dispatch.
    Dispatch(SingleDispatch<'a>),
}

/// A dispatch of a scene that is looked at.
#[derive(Clone, Copy, Debug)]
pub struct SingleDispatch<'a> {
    /// Index of the pass in the scene.
    pub number: usize,
    /// The pass.
    pub pass: &'a Pass,
    /// The index of the dispatch in [`Assembled::dispatches`].
    pub index: usize,
    /// The dispatch.
    pub dispatch: &'a Dispatch,
}

impl SinglePass<'_> {
    /// Index of the pass in the scene.
    pub fn number(&self) -> usize {
        match self {
            Self::Launch(launch) => launch.number,
            Self::Dispatch(dispatch) => dispatch.number,
        }
    }

    /// Invocations of a workgroup along x, y and z; `None` of a launch.
    pub fn workgroup_size(&self) -> Option<[u32; 3]> {
        match self {
            Self::Launch(_) => None,
            Self::Dispatch(SingleDispatch { dispatch, .. }) => Some(dispatch.compute.workgroup_size()),
        }
    }

    /// Number of invocations along x, y and z, in the resources as a frame holds them.
    pub fn size_in(&self, assembled: &Assembled, resources: &Resources) -> [u32; 3] {
        match self {
            Self::Launch(launch) => launch.size_in(&launch.resources(resources)),
            Self::Dispatch(SingleDispatch { pass, dispatch, .. }) => {
                let resources = assembled.pass_resources(pass, resources);
                dispatch.invocations(dispatch.groups(&resources))
            }
        }
    }

    /// Number of invocations along x, y and z, unless a buffer holds it.
    pub fn size(&self) -> [u32; 3] {
        match self {
            Self::Launch(launch) => launch.size,
            Self::Dispatch(SingleDispatch { dispatch, .. }) => dispatch.invocations(dispatch.given_groups),
        }
    }
}

/// A launch of a scene in which single rays and invocations run.
#[derive(Clone, Debug)]
pub struct SingleLaunch<'a> {
    assembled: &'a Assembled,
    /// Index of the pass in the scene.
    pub number: usize,
    /// The pass.
    pub pass: Cow<'a, Pass>,
    /// The pipeline, with the record that is launched.
    pub pipeline: Cow<'a, Pipeline>,
    /// The pipeline's index among the named ones; `None` for `[pipeline]`.
    pub index: Option<usize>,
    /// Width, height and depth, unless a buffer holds them.
    pub size: [u32; 3],
}

impl SingleLaunch<'_> {
    /// Width, height and depth, in the resources as the launch finds them.
    pub fn size_in(&self, resources: &Resources) -> [u32; 3] {
        indirect_size(resources).unwrap_or(self.size)
    }

    /// These resources as the launch finds them.
    pub fn resources<'r>(&self, resources: &'r Resources) -> Cow<'r, Resources> {
        self.assembled.pass_resources(&self.pass, resources)
    }

    /// Runs the passes before it, as [`Assembled::run_before`] does.
    ///
    /// # Errors
    /// As [`Assembled::run`].
    pub fn run_before(&self, resources: &Resources) -> Result<()> {
        self.assembled.run_before(self.number, resources)
    }

    /// The pass's name or number, where the scene lists its passes.
    pub fn told(&self) -> Option<String> {
        self.assembled.is_frame().then(|| self.pass.key(self.number))
    }
}
