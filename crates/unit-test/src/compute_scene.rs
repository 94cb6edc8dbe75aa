//! A compute test as a scene of one dispatch, for what runs scenes: explanations, the debugger and
//! drawn choices.

use std::path::Path;

use crate::compute_test::ComputeTest;
use crate::explain::EXPLAINED_LINES;
use crate::memory;
use anyhit_base::error::{Place, Result};
use anyhit_debugger::line_recorder::FollowedRuns;
use anyhit_debugger::session::{ExplainRequest, Session};
use anyhit_debugger::source_text::source_text;
use anyhit_engine::machine::{Binding, Descriptor};
use anyhit_engine::pipeline::Pipeline;
use anyhit_explain::render::{self, RenderOptions};
use anyhit_scene::files::{DiskFiles, Files};
use anyhit_scene::pass::{Dispatch, Pass, PassWork};
use anyhit_scene::resolved::{ResolvedBinding, ResolvedDispatch, ResolvedShader, UnboundBuffer};
use anyhit_scene::resources::Resource;
use anyhit_scene::{Assembled, LoadOptions, ResolvedScene, SceneFiles, load_text};

impl ComputeTest {
    /// Explains an invocation, given by its `GlobalInvocationId`, as `anyhit trace-one-ray` does:
    /// its builtins, its ray queries, its last lines and what it changed in memory. Its workgroup
    /// runs with it, on a copy of what the test gives.
    ///
    /// ```
    /// use anyhit::{ComputeTest, Module};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// const DOUBLE: &str = "
    /// @group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
    /// @compute @workgroup_size(2)
    /// fn double(@builtin(global_invocation_id) id: vec3u) { numbers[id.x] *= 2.0; }";
    /// let test = ComputeTest::new(&Module::from_source("double.wgsl", DOUBLE)?, "double")?;
    /// let text = test.buffer(0, 0, &[1.0f32, 4.0]).explain([1, 0, 0])?;
    /// assert!(text.contains("float 4 -> 8"), "{text}");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `InvalidArgument` for an invocation outside of the workgroups; else the mistakes of
    /// [`ComputeTest::run`] in what the test gives. A trap is part of the text.
    pub fn explain(&self, id: [u32; 3]) -> Result<String> {
        let (scene, assembled) = self.scene_of_dispatch()?;
        let session = Session::of_assembled(scene, assembled);
        let request = ExplainRequest::Invocation { dispatch: 0, id };
        let read = &mut |name: &str| source_text(Path::new(""), name, &mut |path| DiskFiles.read(path).ok());
        let (transcript, _) = session.run_with_lines(&request, &|_| FollowedRuns::All, read)?;
        let last_lines = Some(EXPLAINED_LINES);
        Ok(render::text(&transcript, RenderOptions { summary: true, last_lines, ..RenderOptions::default() }))
    }

    /// The test as a scene that dispatches its shader on copies of what the test gives. The
    /// contents of resources are in the assembled scene alone.
    ///
    /// # Errors
    /// The mistakes of [`ComputeTest::run`] in what the test gives.
    #[doc(hidden)]
    pub fn scene_of_dispatch(&self) -> Result<(ResolvedScene, Assembled)> {
        let program = &self.compute.program;
        self.given.check(program)?;
        let resources = memory::copied(&self.given.resources);
        let path = format!("compute shader `{}`", program.name);
        let empty = "version = 1";
        let mut scene = load_text(path.as_ref(), empty, &SceneFiles::default(), &LoadOptions::default())?;
        let place = Place::File(path.into());
        scene.pipeline.subgroup_size = Some(self.compute.subgroup_size).filter(|_| self.sets_subgroup_size);
        let shader = ResolvedShader {
            module: 0,
            entry: program.name.clone(),
            specialization: Vec::new(),
            place: place.clone(),
        };
        let groups = self.groups;
        scene.dispatches.push(ResolvedDispatch { shader, groups, indirect: None, push_constants: None });
        for (&at, elements) in &resources.descriptors {
            for (element, descriptor) in (0..).zip(elements) {
                let name = self.name_of(at);
                if let Descriptor::AccelerationStructure(tlas) = descriptor {
                    scene.tlas.push((name.clone(), tlas.clone()));
                }
                scene.resources.push(ResolvedBinding {
                    name,
                    set: at.set,
                    binding: at.binding,
                    declared_at: [at.set, at.binding],
                    passes: None,
                    element,
                    resource: Resource::NullBuffer,
                    address: Default::default(),
                    output: None,
                    keeps_alpha: false,
                    place: place.clone(),
                });
            }
        }
        for (name, _) in resources.memory.named_buffers() {
            scene.unbound.push(UnboundBuffer {
                name: name.to_string(),
                data: Default::default(),
                address: Default::default(),
                place: place.clone(),
            });
        }
        let dispatch =
            Dispatch { compute: self.compute.clone(), given_groups: self.groups, push_constants: None };
        let pass = Pass {
            name: None,
            own_bindings: Vec::new(),
            rebindings: Vec::new(),
            indirect: None,
            work: PassWork::Dispatch(0),
        };
        let assembled = Assembled {
            pipeline: Pipeline::builder().build()?,
            pipelines: Vec::new(),
            resources,
            size: [0; 3],
            dispatches: vec![dispatch],
            notes: Vec::new(),
            passes: vec![pass],
        };
        Ok((scene, assembled))
    }

    /// The name of the variable at a binding.
    fn name_of(&self, at: Binding) -> String {
        let program = &self.compute.program;
        let entry = program
            .module
            .entry_points
            .iter()
            .find(|entry| entry.stage == program.stage && entry.name == program.name);
        let mut variables =
            entry.map_or_else(Vec::new, |entry| program.module.interface_of(entry)).into_iter();
        let found = variables.find(|one| one.descriptor_set.zip(one.binding) == Some((at.set, at.binding)));
        let name = found.map(|variable| variable.name).filter(|name| !name.is_empty());
        name.unwrap_or_else(|| format!("set {}, binding {}", at.set, at.binding))
    }
}
