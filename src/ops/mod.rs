//! The instruction set: one file per section of the SPIR-V specification.

pub mod arithmetic;
pub mod bit;
pub mod conversion;
pub mod glsl;
pub mod relational_logical;
pub mod row;

use crate::ops::row::Family;

/// The families of every section.
pub static SECTIONS: &[&[&Family]] = &[
    arithmetic::FAMILIES,
    bit::FAMILIES,
    conversion::FAMILIES,
    glsl::FAMILIES,
    relational_logical::FAMILIES,
];
