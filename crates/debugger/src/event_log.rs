//! Collects the events of an invocation, and when between them it printed.

use std::sync::Arc;

use anyhit_engine::machine::Printed;
use anyhit_engine::pipeline::{Event, PipelineObserver};

/// The events of an invocation.
#[derive(Debug)]
pub(super) struct EventLog {
    /// The events, those of ray queries included.
    pub events: Vec<Event>,
    /// By text that the invocation printed: how many events were before it.
    before: Vec<usize>,
    printed: Option<Arc<Printed>>,
    launch_id: [u32; 3],
}

impl EventLog {
    /// The log of an invocation that prints to `printed`.
    pub(super) fn new(printed: Option<Arc<Printed>>, launch_id: [u32; 3]) -> Self {
        Self { events: Vec::new(), before: Vec::new(), printed, launch_id }
    }

    /// Notes what was printed since the last event.
    pub(super) fn look(&mut self) {
        if let Some(printed) = &self.printed {
            self.before.resize(printed.count_of(self.launch_id), self.events.len());
        }
    }

    /// The events, and the invocation's texts, which were taken after the last look, each with the
    /// number of events before it.
    pub(super) fn finish(self, texts: impl Iterator<Item = String>) -> (Vec<Event>, Vec<(usize, String)>) {
        let printed = self.before.iter().copied().zip(texts).collect();
        (self.events, printed)
    }
}

impl PipelineObserver for EventLog {
    fn observes_query_traversal(&self) -> bool {
        true
    }

    fn event(&mut self, event: Event) {
        self.look();
        self.events.push(event);
    }
}
