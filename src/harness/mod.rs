//! Tests of shaders: expectations, and the cases that hold them.

pub mod case;
pub mod expect;
mod memory;
pub mod number;
