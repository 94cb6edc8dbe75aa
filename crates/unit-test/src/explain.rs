//! The explanation beneath a failed assertion: the text of `anyhit trace-one-ray`, for a ray or a
//! shader run from Rust. It is rendered only on request.

use std::borrow::Cow;
use std::fmt;
#[cfg(feature = "debugger")]
use std::path::Path;
use std::sync::Arc;

use crate::memory;
#[cfg(feature = "debugger")]
use anyhit_debugger::debugger::Debugger;
#[cfg(feature = "debugger")]
use anyhit_debugger::line_recorder::{FollowedRuns, add_lines_of};
#[cfg(feature = "debugger")]
use anyhit_debugger::source_text::source_text;
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::{DeviceMemory, Resources};
#[cfg(feature = "debugger")]
use anyhit_engine::pipeline::SteppedLaunch;
use anyhit_engine::pipeline::{Event, Launch, Pipeline, RayOperands};
use anyhit_engine::program::Program;
use anyhit_explain::hints::hints;
use anyhit_explain::names::Names;
use anyhit_explain::reader::EventReader;
use anyhit_explain::render::{self, RenderOptions};
use anyhit_explain::transcript::Step;
#[cfg(feature = "debugger")]
use anyhit_scene::files::{DiskFiles, Files};

/// How many lines of a shader that decided are shown, unless another number is asked for.
pub const EXPLAINED_LINES: usize = 10;

/// A result that can explain how it came about.
pub trait Explain {
    /// Returns what happened as text.
    #[must_use]
    fn explain(&self) -> String;
}

/// A ray or a shader run, kept so that it can be explained.
pub(crate) enum Explanation {
    /// A ray; it is traced again.
    Ray(Box<TracedRay>),
    /// A single shader: its events, and what answered its calls.
    Shader { program: Arc<Program>, events: Vec<Event>, calls: Vec<String>, memory: DeviceMemory },
}

/// A ray that a host traced.
pub(crate) struct TracedRay {
    pub pipeline: Pipeline,
    pub tlas: Arc<Tlas>,
    pub operands: RayOperands,
    /// The resources that it was given; it is traced again on a copy.
    pub resources: Resources,
}

/// What is explained, without its events.
impl fmt::Debug for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ray(_) => "Explanation(a ray)",
            Self::Shader { .. } => "Explanation(a shader)",
        })
    }
}

impl Explanation {
    /// Renders the explanation.
    pub(crate) fn text(&self) -> String {
        let (title, pipeline, events, calls, memory) = match self {
            Self::Ray(ray) => {
                let TracedRay { pipeline, tlas, operands, resources } = &**ray;
                let (own, resources) = memory::copied_for_run(pipeline, resources);
                let launch = Launch { pipeline: &own, resources: &resources };
                let mut events: Vec<Event> = Vec::new();
                // A trap is among the events, too.
                let _ = launch.trace(tlas, operands.clone(), Some(&mut events));
                ("the ray, traced again", Cow::Borrowed(pipeline), events, &[][..], resources.memory)
            }
            Self::Shader { program, events, calls, memory } => {
                let pipeline = Cow::Owned(Pipeline::of_shader(program));
                ("the shader alone", pipeline, events.clone(), &calls[..], memory.clone())
            }
        };
        let names = Names::unnamed(&pipeline).with_memory(&memory);
        let Some(mut root) = EventReader::new(&pipeline, names, events).root() else {
            return String::new();
        };
        self.add_lines(&mut root);
        let options = RenderOptions { last_lines: Some(EXPLAINED_LINES), ..RenderOptions::default() };
        let mut text = render::step(title, &hints(&root, &[]), &root, options);
        for call in calls {
            text.push_str(call);
            text.push('\n');
        }
        text
    }

    /// Adds the lines of the any-hit and intersection shaders that decided a ray; without them the
    /// explanation still stands.
    #[cfg(feature = "debugger")]
    fn add_lines(&self, root: &mut Step) {
        let Self::Ray(ray) = self else { return };
        let TracedRay { pipeline, tlas, operands, resources } = &**ray;
        let runs = FollowedRuns::of_deciders(root);
        if runs == FollowedRuns::Only(Vec::new()) {
            return;
        }
        let (pipeline, resources) = memory::copied_for_run(pipeline, resources);
        let Ok(pipeline) = pipeline.partly_unoptimized(|_| true).map(Arc::new) else { return };
        let stepped = SteppedLaunch::<1>::of_ray(pipeline.clone(), &resources, tlas, operands.clone());
        let Ok(stepped) = stepped else { return };
        let mut debugger = Debugger::with(Box::new(stepped), pipeline, &resources);
        debugger.supply_texts(&mut |name| {
            source_text(Path::new(""), name, &mut |path| DiskFiles.read(path).ok())
        });
        add_lines_of(debugger, root, runs);
    }

    /// Lines are followed by the debugger, which reads scenes.
    #[cfg(not(feature = "debugger"))]
    fn add_lines(&self, _: &mut Step) {}
}
