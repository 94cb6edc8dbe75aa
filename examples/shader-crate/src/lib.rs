//! Shaders of an application, compiled when it is built.

/// The closest-hit shader of linear swept spheres (`shaders/lss.rchit`), as SPIR-V.
pub const LSS_CLOSEST_HIT: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/lss.rchit.spv"));

/// The closest-hit shader in Slang (`shaders/lss.slang`), with the entry point `lss`.
pub const LSS_SLANG: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/lss.slang.spv"));
