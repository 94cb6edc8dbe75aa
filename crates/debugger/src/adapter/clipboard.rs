//! Values that a client copies: with all their parts.

use emmy_dap_types::responses::EvaluateResponse;

use crate::debugger::lane_state::LaneState;
use crate::debugger::{StackFrame, VariablePlace};
use anyhit_engine::module::ty::Type;

use super::Launched;
use super::protocol::{Answer, body};

/// The most parts that the text of a value has.
const MOST_PARTS: u64 = 1 << 20;

impl Launched {
    /// The value of an expression without an array that is cut.
    pub(super) fn copied(&mut self, frame: &StackFrame, expression: &str) -> Answer {
        let debugger = &mut self.console.debugger;
        let (result, ty) = match debugger.place(frame, expression) {
            Ok(place) => {
                let mut left = MOST_PARTS;
                let text = debugger.with_lane(frame, |lane| whole_text(&place, lane, &mut left));
                (text, place.type_name())
            }
            Err(_) => {
                let value = debugger.evaluate(frame, expression)?;
                (value.content.to_string(), value.ty)
            }
        };
        let result = result.trim().to_owned();
        body(EvaluateResponse { result, type_field: Some(ty), ..EvaluateResponse::default() })
    }
}

/// The text of a value with its members and elements, as long as parts are left.
fn whole_text(place: &VariablePlace, lane: &dyn LaneState, left: &mut u64) -> String {
    let is_struct = match place.module().ty(place.ty()) {
        Type::Struct { .. } => true,
        Type::Array { .. } | Type::RuntimeArray { .. } => false,
        _ => {
            return match place.value(lane) {
                Ok(value) => value.content.to_string().trim().to_owned(),
                Err(why) => format!("<{why}>"),
            };
        }
    };
    let count = match (place.why_unavailable(), place.child_count(lane)) {
        (Some(why), _) => return format!("<{why}>"),
        (None, Err(why)) => return format!("<{why}>"),
        (None, Ok(count)) if count > *left => return format!("<{count} elements>"),
        (None, Ok(count)) => count,
    };
    *left -= count;
    let parts = place.children(0..count, lane).into_iter().map(|(name, part)| match is_struct {
        true => format!("{name}: {}", whole_text(&part, lane, left)),
        false => whole_text(&part, lane, left),
    });
    let parts = parts.collect::<Vec<_>>().join(", ");
    if is_struct { format!("{{ {parts} }}") } else { format!("({parts})") }
}
