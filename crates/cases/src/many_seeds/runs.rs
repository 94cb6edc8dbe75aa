//! Runs of a scene with drawn choices, compared with the run in which none is drawn.

use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

use crate::expect::{Expectations, Observed};
use crate::many_seeds::values::{OpenValues, ValueDraws};
use crate::module_files::module_files;
use crate::observe::{first_ray, fresh_resources, read_resources};
use crate::stability::UnstableOutput;
use crate::stability::outputs::OutputComparison;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_debugger::session::{ResolvedRequest, SingleRun};
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::{
    ChoiceKind, ChoiceLog, ChoiceSite, Observer, OpenChoices, OrderLimits, OrderPart, Resources, ShaderIndex,
};
use anyhit_engine::math::random::Random;
use anyhit_engine::pipeline::{Event, Launch, PipelineObserver, RunOptions};
use anyhit_engine::program::Program;
use anyhit_sanitize::Levels;
use anyhit_scene::indirect::indirect_size;
use anyhit_scene::pass::{Pass, PassWork};
use anyhit_scene::{Assembled, ResolvedScene};

/// The sizes of subgroups that devices have: from 8 of a CPU to 64 of AMD's GPUs.
const SUBGROUP_SIZES: [u32; 4] = [8, 16, 32, 64];

/// What is drawn in a run.
#[derive(Clone, Debug)]
pub(super) struct Drawing {
    /// The seed.
    pub seed: u64,
    /// The choices.
    pub kinds: BTreeSet<ChoiceKind>,
    /// Where they are drawn; `None` for everywhere.
    pub only: Option<Arc<BTreeSet<ChoiceSite>>>,
    /// How much of the orders that are drawn is kept; `None` for all.
    pub orders: Option<OrderLimits>,
    /// Where it is noted what was drawn.
    pub log: Option<Arc<ChoiceLog>>,
}

impl Drawing {
    /// All draws of some choices.
    pub(super) fn of(seed: u64, kinds: BTreeSet<ChoiceKind>) -> Self {
        Self { seed, kinds, only: None, orders: None, log: None }
    }

    /// The choices of a pass.
    fn of_pass(&self, pass: u32) -> OpenChoices {
        let Self { seed, kinds, only, orders, log } = self.clone();
        OpenChoices { seed, pass, shader: ShaderIndex(0), kinds, only, orders, log }
    }
}

/// How the outputs of a run differ from those of the run without draws.
#[derive(Clone, Debug)]
pub(super) enum RunDifference {
    /// A value does.
    Value {
        /// Its name: `` `image` texel (4, 2).r ``.
        name: String,
        /// The value without draws.
        own: String,
        /// The value with draws.
        drawn: String,
    },
    /// The run ends with a trap.
    Trap(Error),
}

/// The name of the resource in the name of a value, between two back quotes.
fn resource_of(value: &str) -> Option<&str> {
    value.split('`').nth(1)
}

/// A scene that is run again and again.
pub(super) struct Runs<'a> {
    scene: &'a ResolvedScene,
    /// The ray or invocation that runs alone; `None` for all passes.
    which: Option<&'a ResolvedRequest>,
    /// The scene with its pipelines and resources, which no run changes.
    assembled: &'a Assembled,
    /// Its shaders without optimization, for runs in which values are drawn.
    reference: Assembled,
    /// By pass, what is open about the values of its shaders.
    values: Vec<Vec<OpenValues>>,
    /// What the scene expects, whose tolerances hold for its outputs.
    expectations: Expectations,
    /// What the run without draws leaves behind.
    own: Observed,
    /// The sizes of passes that buffers hold.
    indirect_sizes: OnceLock<Vec<Option<[u32; 3]>>>,
}

impl<'a> Runs<'a> {
    /// Runs the scene without draws.
    ///
    /// # Errors
    /// The trap, those of lowering a shader without optimization, and mistakes in `[expect]`.
    pub(super) fn new(
        scene: &'a ResolvedScene,
        assembled: &'a Assembled,
        which: Option<&'a ResolvedRequest>,
        levels: &Levels,
    ) -> Result<Self> {
        let reference = assembled.unoptimized()?;
        let of_program = |program: &Arc<Program>| OpenValues::of(program, levels);
        let of_pass = |pass: &Pass| match &pass.work {
            PassWork::Launch(launch) => {
                reference.pipeline_at(launch.pipeline).programs.iter().map(of_program).collect()
            }
            PassWork::Dispatch(at) => vec![of_program(&reference.dispatches[*at].compute.program)],
        };
        // A ray from the host needs no launch: then the pipeline stands alone.
        let mut values: Vec<_> = reference.passes.iter().map(of_pass).collect();
        if values.is_empty() {
            values.push(reference.pipeline.programs.iter().map(of_program).collect());
        }
        let mut expectations = Expectations::read(&scene.document)?;
        expectations.read_with(&scene.files);
        let own = Observed::default();
        let mut runs = Self {
            scene,
            which,
            assembled,
            reference,
            values,
            expectations,
            own,
            indirect_sizes: OnceLock::new(),
        };
        runs.own = runs.run(None)?;
        Ok(runs)
    }

    /// The program of a shader of a pass, as it runs where some choice is drawn.
    pub(super) fn program(&self, site: ChoiceSite, shader: ShaderIndex) -> Option<Arc<Program>> {
        let assembled = if site.kind.is_of_values() { &self.reference } else { self.assembled };
        let Some(pass) = assembled.passes.get(site.pass as usize) else {
            return assembled.pipeline.programs.get(shader.index()).cloned();
        };
        match &pass.work {
            PassWork::Launch(launch) => {
                assembled.pipeline_at(launch.pipeline).programs.get(shader.index()).cloned()
            }
            PassWork::Dispatch(index) => Some(assembled.dispatches[*index].compute.program.clone()),
        }
    }

    /// The file of the module that a shader of a pass comes from.
    pub(super) fn module_file(&self, site: &ChoiceSite, shader: ShaderIndex) -> Option<String> {
        // The shader of a dispatch is number 0.
        let pass = self.assembled.passes.get(site.pass as usize);
        let first = pass.map_or(0, |pass| self.assembled.first_program_of(pass));
        module_files(self.scene, self.assembled).into_iter().nth(first + shader.index())
    }

    /// The size of a pass: the given one, unless a buffer holds it.
    fn size_of(&self, pass: u32, given: [u32; 3]) -> [u32; 3] {
        let sizes = self.indirect_sizes.get();
        sizes.and_then(|sizes| *sizes.get(pass as usize)?).unwrap_or(given)
    }

    /// How many invocations or workgroups of a pass stand in an order.
    pub(super) fn ordered_count(&self, pass: u32, part: OrderPart) -> u64 {
        let count = |sides: [u32; 3]| sides.into_iter().map(u64::from).product();
        match (self.pass_work(pass), part) {
            (Some(PassWork::Launch(launch)), OrderPart::Grid) => count(self.size_of(pass, launch.given_size)),
            (Some(&PassWork::Dispatch(at)), OrderPart::Grid) => {
                count(self.size_of(pass, self.assembled.dispatches[at].given_groups))
            }
            (Some(&PassWork::Dispatch(at)), OrderPart::Workgroup) => count(self.workgroup_size(at)),
            _ => 0,
        }
    }

    /// The name of an invocation or a workgroup of a pass, or of the units of them that move
    /// together from there on.
    pub(super) fn name_of_unit(&self, pass: u32, part: OrderPart, unit: u64, number: u64) -> String {
        let place = |[width, height, _]: [u32; 3], number: u64| {
            let (width, height) = (u64::from(width), u64::from(height));
            format!("({}, {}, {})", number % width, number / width % height, number / (width * height))
        };
        let name = match (self.pass_work(pass), part) {
            (Some(PassWork::Launch(launch)), _) => {
                format!("invocation {}", place(self.size_of(pass, launch.given_size), number))
            }
            (Some(&PassWork::Dispatch(at)), OrderPart::Grid) => {
                let groups = self.size_of(pass, self.assembled.dispatches[at].given_groups);
                format!("workgroup {}", place(groups, number))
            }
            (Some(&PassWork::Dispatch(at)), OrderPart::Workgroup) => {
                let layout = self.assembled.dispatches[at].compute.program.workgroup;
                let number = layout.map_or(number, |layout| layout.index_of(number as u32).into());
                format!("local invocation {}", place(self.workgroup_size(at), number))
            }
            (None, _) => format!("invocation {number}"),
        };
        if unit > 1 { format!("the {unit} invocations starting at {name}") } else { name }
    }

    fn pass_work(&self, pass: u32) -> Option<&PassWork> {
        self.assembled.passes.get(pass as usize).map(|pass| &pass.work)
    }

    fn workgroup_size(&self, dispatch: usize) -> [u32; 3] {
        let program = &self.assembled.dispatches[dispatch].compute.program;
        program.workgroup.map_or([1; 3], |layout| layout.size)
    }

    /// Runs the scene with draws; how its outputs then differ, if they do.
    pub(super) fn difference(&self, drawing: &Drawing) -> Option<RunDifference> {
        match self.run(Some(drawing)) {
            Err(error) if error.kind() == ErrorKind::Trap => Some(RunDifference::Trap(error)),
            Err(_) => None,
            Ok(observed) => {
                let mut comparison = OutputComparison::new(self.assembled, &self.own, 0.0);
                comparison.add(1, &observed);
                let is_told = |one: &UnstableOutput| {
                    resource_of(&one.name).is_none_or(|name| !self.expectations.tolerates(name, &observed))
                };
                let first = comparison.unstable().into_iter().find(is_told)?;
                Some(RunDifference::Value { name: first.name, own: first.reference, drawn: first.other })
            }
        }
    }

    /// A number that tells the output in which a difference is from those of this scene and others.
    pub(super) fn output_hash(&self, difference: &RunDifference) -> u64 {
        let name = match difference {
            RunDifference::Value { name, .. } => resource_of(name).unwrap_or(name),
            RunDifference::Trap(error) => error.message(),
        };
        let path = escape::path(&self.scene.path).to_string();
        Random::of(0, path.bytes().chain([0]).chain(name.bytes()).map(u64::from)).bits()
    }

    /// Runs all passes on a copy of the resources.
    fn run(&self, drawing: Option<&Drawing>) -> Result<Observed> {
        let resources = fresh_resources(self.assembled);
        if let Some(which) = self.which {
            return self.run_one(which, &resources, drawing);
        }
        let mut sizes = Vec::new();
        for (number, pass) in self.assembled.passes.iter().enumerate() {
            let mut own = self.assembled.pass_resources(pass, &resources).into_owned();
            own.choices = drawing.map(|drawing| Arc::new(drawing.of_pass(number as u32)));
            sizes.push(indirect_size(&own));
            match &own.choices {
                Some(choices) if choices.kinds.iter().any(|kind| kind.is_of_values()) => {
                    let draws = ValueDraws::new(&self.values[number], choices);
                    self.run_observed(&self.reference.passes[number], &own, draws)?;
                }
                choices => {
                    let size = choices.as_deref().and_then(|choices| self.draw_subgroup_size(choices, pass));
                    self.run_pass(pass, &own, size)?;
                }
            }
        }
        // Those of the first run, in which nothing is drawn.
        let _ = self.indirect_sizes.set(sizes);
        let mut observed = Observed::default();
        read_resources(self.scene, &resources, &mut observed);
        Ok(observed)
    }

    /// Runs one ray or invocation, after the passes before it, in which nothing is drawn.
    fn run_one(
        &self,
        which: &ResolvedRequest,
        resources: &Resources,
        drawing: Option<&Drawing>,
    ) -> Result<Observed> {
        let is_of_values =
            drawing.is_some_and(|drawing| drawing.kinds.iter().any(|kind| kind.is_of_values()));
        let assembled = if is_of_values { &self.reference } else { self.assembled };
        let single = assembled.single_launch(which.pass.as_deref())?;
        single.run_before(resources)?;
        let mut own = single.resources(resources).into_owned();
        own.choices = drawing.map(|drawing| Arc::new(drawing.of_pass(single.number as u32)));
        let launch = Launch { pipeline: &single.pipeline, resources: &own };
        let mut events = Vec::new();
        let mut sink = |event: Event| events.push(event);
        match own.choices.as_deref().filter(|_| is_of_values) {
            Some(choices) => {
                let mut draws = ValueDraws::new(&self.values[single.number], choices);
                self.run_single(&launch, single.size_in(&own), which, &mut sink, Some(&mut draws))?;
            }
            None => self.run_single(&launch, single.size_in(&own), which, &mut sink, None)?,
        }
        let mut observed = Observed::default();
        observed.rays.push((None, Ok(first_ray(&single.pipeline, &events))));
        read_resources(self.scene, resources, &mut observed);
        Ok(observed)
    }

    /// Runs one ray or invocation of a launch under an observer.
    fn run_single(
        &self,
        launch: &Launch<'_>,
        size: [u32; 3],
        which: &ResolvedRequest,
        sink: &mut dyn PipelineObserver,
        observer: Option<&mut dyn Observer<1>>,
    ) -> Result<()> {
        match &which.what {
            SingleRun::Pixel(id) => launch.run_one(*id, size, Some(sink), observer)?,
            SingleRun::Ray(given) => {
                let tlas = self.scene.tlas.first().map_or_else(|| Tlas::empty(), |(_, tlas)| tlas);
                launch.trace_observed(tlas, given.operands(launch.pipeline)?, Some(sink), observer)?.stats
            }
        };
        Ok(())
    }

    /// Runs a pass, with subgroups of another size where that is drawn.
    fn run_pass(&self, pass: &Pass, resources: &Resources, subgroup_size: Option<u32>) -> Result<()> {
        match &pass.work {
            PassWork::Launch(launch) => {
                let mut pipeline = self.assembled.pass_pipeline(launch);
                if let Some(size) = subgroup_size {
                    pipeline.to_mut().subgroup_size = size;
                }
                Launch { pipeline: &pipeline, resources }
                    .run(launch.size(resources), RunOptions::default())?;
            }
            PassWork::Dispatch(index) => {
                let dispatch = &self.assembled.dispatches[*index];
                let sized = |size| dispatch.compute.clone().subgroup_size(size);
                let drawn = subgroup_size.map(sized).transpose()?;
                let compute = drawn.as_ref().unwrap_or(&dispatch.compute);
                compute.run(resources, dispatch.groups(resources), RunOptions::default())?;
            }
        }
        Ok(())
    }

    /// Runs a pass without optimization, under an observer that draws values.
    fn run_observed(&self, pass: &Pass, resources: &Resources, mut draws: ValueDraws<'_>) -> Result<()> {
        match &pass.work {
            PassWork::Launch(launch) => {
                let pipeline = self.reference.pass_pipeline(launch);
                let one = Launch { pipeline: &pipeline, resources };
                one.run_observed(launch.size(resources), &mut |_: Event| (), &mut draws)?;
            }
            PassWork::Dispatch(index) => {
                let dispatch = &self.reference.dispatches[*index];
                let groups = dispatch.groups(resources);
                dispatch.compute.run_observed(resources, groups, &mut |_| (), &mut draws)?;
            }
        }
        Ok(())
    }

    /// Draws the size of subgroups of a pass that uses them, unless the scene sets it.
    fn draw_subgroup_size(&self, choices: &OpenChoices, pass: &Pass) -> Option<u32> {
        let (is_set, uses_them) = match &pass.work {
            PassWork::Launch(launch) => {
                let pipeline = self.assembled.pipeline_at(launch.pipeline);
                (
                    self.scene.pipeline_at(launch.pipeline).subgroup_size.is_some(),
                    pipeline.programs.iter().any(|program| program.sees_subgroups()),
                )
            }
            PassWork::Dispatch(index) => {
                let program = &self.assembled.dispatches[*index].compute.program;
                (self.scene.pipeline.subgroup_size.is_some(), program.sees_subgroups())
            }
        };
        if is_set || !uses_them {
            return None;
        }
        let mut random = choices.draw_of_pass(ChoiceKind::SubgroupSize)?;
        Some(SUBGROUP_SIZES[random.below(SUBGROUP_SIZES.len() as u64) as usize])
    }
}
