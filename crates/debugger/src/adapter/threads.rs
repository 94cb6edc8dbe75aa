//! Threads: the invocation that is debugged, and the lanes that run with it.

use serde_json::{Value, json};

use crate::debugger::{DebuggedLane, LaneActivity};
use crate::session::ExplainRequest;

use super::protocol::Refusal;
use super::{Adapter, Launched, THREAD};

/// The number of the thread that lane 0 would be.
const FIRST_LANE: i64 = THREAD + 1;

impl Adapter {
    /// The invocation that is debugged, and behind it the other lanes of its subgroup.
    pub(super) fn threads(&self) -> Value {
        let Some(launched) = &self.launched else {
            return json!({ "threads": [{ "id": THREAD, "name": "no invocation yet" }] });
        };
        let lanes = launched.console.debugger.lanes();
        let own_name = match lanes.iter().find(|lane| lane.is_followed) {
            Some(own) => format!("lane {}, {}, followed", own.lane, launched.name),
            None => launched.name.clone(),
        };
        let own = json!({ "id": THREAD, "name": own_name });
        let others = lanes.iter().filter(|lane| !lane.is_followed).map(|lane| {
            let id = FIRST_LANE + lane.lane as i64;
            json!({ "id": id, "name": launched.lane_name(lane) })
        });
        json!({ "threads": std::iter::once(own).chain(others).collect::<Vec<_>>() })
    }

    /// Checks that a thread is the invocation that is debugged: a step is one of that.
    pub(super) fn check_steps(&self, thread: i64) -> Result<(), Refusal> {
        let launched = self.launched.as_ref();
        match launched.map(|launched| launched.lane_of(thread)).transpose()?.flatten() {
            None => Ok(()),
            Some(lane) => Err(Refusal::shown(format!(
                "lane {lane} runs in lockstep with the followed invocation, thread {THREAD}: step that \
                 thread, or launch this invocation"
            ))),
        }
    }
}

impl Launched {
    /// The lane that a thread is; `None` for the invocation that is debugged.
    pub(super) fn lane_of(&self, thread: i64) -> Result<Option<usize>, Refusal> {
        if thread == THREAD {
            return Ok(None);
        }
        let lanes = self.console.debugger.lanes();
        let mut others = lanes.iter().filter(|lane| !lane.is_followed).map(|lane| lane.lane);
        let found = others.find(|&lane| FIRST_LANE + lane as i64 == thread);
        found.map(Some).ok_or_else(|| Refusal::new(format!("thread {thread} does not exist")))
    }

    /// A lane in words, with what it does.
    fn lane_name(&self, lane: &DebuggedLane) -> String {
        let activity = match lane.activity {
            LaneActivity::Active => "active",
            LaneActivity::Diverged => "inactive: waits for reconvergence",
            LaneActivity::Waiting => "inactive: waits for a shader that runs for other lanes",
            LaneActivity::Ended => "ended",
        };
        let [x, y, z] = lane.launch_id;
        let invocation = match (&self.request, z) {
            (ExplainRequest::Invocation { .. }, _) => format!("invocation ({x}, {y}, {z})"),
            (_, 0) => format!("pixel ({x}, {y})"),
            _ => format!("pixel ({x}, {y}, {z})"),
        };
        format!("lane {}, {invocation}, {activity}", lane.lane)
    }
}
