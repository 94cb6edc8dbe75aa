//! The source-level debugger: variables of a stopped invocation and expressions of them.

pub mod expression;
mod id_places;
pub mod lane_state;
mod place_memory;
pub mod source_frames;
mod source_locals;
mod value_layout;
mod value_paths;
pub mod variable_place;
pub mod variables;

pub use lane_state::LaneState;
pub use source_frames::{SourceFrame, source_frames};
pub use variable_place::VariablePlace;
pub use variables::{
    Variable, VariableKind, global_variables, temporaries_in_frame, variables_in_frame, variables_in_scope,
};
