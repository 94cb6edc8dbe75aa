//! The explanation beneath a failed assertion: the text of `anyhit trace-one-ray`, for a ray or a
//! shader run from Rust. It is rendered only on request.

use std::sync::Arc;

use crate::accel::Tlas;
use crate::debug::names::Names;
use crate::debug::reader::EventReader;
use crate::debug::render::{self, RenderOptions};
use crate::harness::memory;
use crate::machine::{DeviceMemory, Resources};
use crate::pipeline::{Event, Launch, Pipeline, RayOperands};

/// A result that can explain how it came about.
pub trait Explain {
    /// Returns what happened as text.
    fn explain(&self) -> String;
}

/// A ray or a shader run, kept so that it can be explained.
#[derive(Debug)]
pub(super) struct Explanation {
    pub pipeline: Pipeline,
    pub what: What,
}

#[derive(Debug)]
pub(super) enum What {
    /// A ray; it is traced again, on a copy of the resources as they are then.
    Ray { tlas: Arc<Tlas>, operands: RayOperands, resources: Resources },
    /// A single shader: its events, and what answered its calls.
    Shader { events: Vec<Event>, calls: Vec<String>, memory: DeviceMemory },
}

impl Explanation {
    /// Renders the explanation.
    pub(super) fn text(&self) -> String {
        let (title, events, calls, memory) = match &self.what {
            What::Ray { tlas, operands, resources } => {
                let resources = memory::copied(resources);
                let launch = Launch { pipeline: &self.pipeline, resources: &resources };
                let mut events: Vec<Event> = Vec::new();
                // A trap is among the events, too.
                let _ = launch.trace(tlas, operands.clone(), Some(&mut events));
                ("the ray, traced again", events, &[][..], resources.memory)
            }
            What::Shader { events, calls, memory } => {
                ("the shader by itself", events.clone(), &calls[..], memory.clone())
            }
        };
        let names = Names::unnamed(&self.pipeline).with_memory(&memory);
        let Some(root) = EventReader::new(&self.pipeline, names, events).root() else { return String::new() };
        let mut text = render::step(title, &root, RenderOptions::default());
        for call in calls {
            text.push_str(call);
            text.push('\n');
        }
        text
    }
}
