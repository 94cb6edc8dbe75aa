//! What reasons to stop come to: conditions of breakpoints, how often they were hit, log points.

use super::breakpoint::BreakpointId;
use super::condition::{Reason, Write};
use super::stack::StackFrame;
use super::{Debugger, StopReason};

/// Where a run goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Forwards,
    Backwards,
}

impl Debugger {
    /// What reasons come to; `None` where only breakpoints are met whose condition does not hold,
    /// or that print and go on.
    pub(super) fn decide(&mut self, reasons: &[Reason], direction: Direction) -> Option<StopReason> {
        let (mut hit, mut traversals) = (Vec::new(), Vec::new());
        self.matched_event = None;
        for reason in reasons {
            match reason {
                Reason::Breakpoint(id) if self.stops_at(*id, None, direction) => hit.push(*id),
                Reason::Traversal(Some(id), event) if self.stops_at(*id, Some(*event), direction) => {
                    traversals.push((*id, *event));
                }
                Reason::Breakpoint(_) | Reason::Traversal(Some(_), _) => {}
                Reason::Wrote(write) if self.stops_at_write(write, direction) => {
                    return Some(StopReason::Wrote(write.clone()));
                }
                Reason::Wrote(_) => {}
                Reason::Nan => return Some(StopReason::Nan),
                Reason::Traversal(None, _) => return Some(StopReason::Traversal(None)),
                Reason::Stepped | Reason::Arrived => {}
            }
        }
        if let Some(&(first, event)) = traversals.first() {
            self.matched_event = Some(event);
            return Some(StopReason::Traversal(Some(first)));
        }
        if !hit.is_empty() {
            return Some(StopReason::Breakpoints(hit));
        }
        let stepped = |reason: &Reason| matches!(reason, Reason::Stepped | Reason::Arrived);
        reasons.iter().any(stepped).then_some(StopReason::Step)
    }

    /// Whether a write of what is watched stops: the condition holds behind it, and there were
    /// enough before.
    fn stops_at_write(&mut self, write: &Write, direction: Direction) -> bool {
        let Some(watch) = self.watches.get(write.watch) else { return true };
        let (id, condition, from_hit) = (watch.breakpoint, watch.condition.clone(), watch.from_hit);
        let frame = self.stack().into_iter().next();
        if let (Some(condition), Some(frame)) = (condition, &frame) {
            match self.holds(frame, None, &condition) {
                Ok(true) => {}
                Ok(false) => return false,
                Err(why) => self.print(format!("the condition of a data breakpoint: {why}")),
            }
        }
        let (now, log) = (self.course.time, &mut self.watches[write.watch].hits);
        if direction == Direction::Forwards {
            log.add(now, 0);
        }
        // Those before it was set are not counted.
        if !log.contains(now, 0) {
            return true;
        }
        // A payload is watched in several shaders.
        let all = self.watches.iter().filter(|watch| watch.breakpoint == id);
        all.map(|watch| watch.hits.count(now)).sum::<u64>() >= from_hit
    }

    /// Whether a breakpoint that was reached stops: its condition holds, it was hit often enough,
    /// and it does not only print. Expressions of a breakpoint of traversal are about the event.
    fn stops_at(&mut self, id: BreakpointId, event: Option<usize>, direction: Direction) -> bool {
        let Some(at) = self.breakpoints.iter().position(|breakpoint| breakpoint.id == id) else {
            return false;
        };
        let frame = self.stack().into_iter().next();
        if let (Some(condition), Some(frame)) = (self.breakpoints[at].condition.clone(), &frame) {
            match self.holds(frame, event, &condition) {
                Ok(true) => {}
                Ok(false) => return false,
                Err(why) => self.print(format!("the condition of breakpoint {}: {why}", id.0)),
            }
        }
        let breakpoint = &mut self.breakpoints[at];
        let hit = (self.course.time, event.unwrap_or(0));
        if direction == Direction::Forwards {
            breakpoint.hits.add(hit.0, hit.1);
        }
        // Those before it was set are not counted.
        let is_counted = breakpoint.hits.contains(hit.0, hit.1);
        if is_counted && breakpoint.hits.count_to(hit.0, hit.1) < breakpoint.from_hit {
            return false;
        }
        let Some(log) = breakpoint.log.clone() else { return true };
        if direction == Direction::Forwards
            && let Some(frame) = &frame
        {
            let text = self.interpolate(frame, event, &log);
            self.print(text);
        }
        false
    }

    /// A text in which the values of expressions stand for `{expression}`.
    fn interpolate(&mut self, frame: &StackFrame, event: Option<usize>, text: &str) -> String {
        let mut printed = String::new();
        let mut rest = text;
        while let Some((before, after)) = rest.split_once('{') {
            printed += before;
            let Some((expression, after)) = after.split_once('}') else { return printed + "{" + after };
            printed += &match self.evaluate_at(frame, event, expression) {
                Ok(value) => value.content.to_string(),
                Err(why) => format!("<{why}>"),
            };
            rest = after;
        }
        printed + rest
    }
}
