//! What a compute entry point declares of its workgroups.

use crate::error::Result;
use crate::module::Id;
use crate::module::interface::EntryPoint;
use crate::ops::decode::Decoder;

/// Execution modes, numbers of the specification.
const LOCAL_SIZE: u32 = 17;
const LOCAL_SIZE_ID: u32 = 38;
/// The decoration `BuiltIn` and the builtin `WorkgroupSize`.
const BUILT_IN: u32 = 11;
const WORKGROUP_SIZE: u32 = 25;

/// More invocations than `maxComputeWorkGroupInvocations` of any device.
pub const MAX_INVOCATIONS: u64 = 1 << 16;

/// The workgroups of a compute entry point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkgroupLayout {
    /// `WorkgroupSize`
    pub size: [u32; 3],
    /// Bytes of workgroup memory.
    pub memory: u32,
}

impl WorkgroupLayout {
    /// What an entry point declares, once its instructions are decoded: a constant decorated with
    /// `WorkgroupSize` goes before `LocalSizeId` and `LocalSize` (SPIR-V, Built-In).
    ///
    /// # Errors
    /// `InvalidModule` where nothing tells the size (VUID-StandaloneSpirv-None-10685) or it is zero;
    /// `UnsupportedModule` for sizes beyond those of any device.
    pub fn of(decoder: &mut Decoder<'_>, entry: &EntryPoint) -> Result<Self> {
        decoder.origin.offset = entry.offset;
        let module = decoder.module;
        let decorated = module
            .constants
            .iter()
            .find(|constant| module.decorations.literal(constant.id, BUILT_IN) == Some(WORKGROUP_SIZE));
        let mode = |number| entry.modes.iter().find(|(mode, _)| *mode == number).map(|(_, words)| words);
        let sides: Vec<u64> = if let Some(constant) = decorated {
            let words = decoder.words(constant.id)?;
            words.iter().filter_map(|&reg| decoder.constant_word(reg)).map(u64::from).collect()
        } else if let Some(ids) = mode(LOCAL_SIZE_ID) {
            ids.iter().map(|&id| decoder.constant_integer(Id(id))).collect::<Result<_>>()?
        } else if let Some(sides) = mode(LOCAL_SIZE) {
            sides.iter().map(|&side| u64::from(side)).collect()
        } else {
            let message = format!("compute entry point `{}` declares no workgroup size", entry.name);
            return Err(decoder.invalid(message).note("VUID-StandaloneSpirv-None-10685"));
        };
        let &[x, y, z] = &sides[..] else {
            return Err(decoder.invalid(format!("entry point `{}`: a workgroup has three sides", entry.name)));
        };
        let count = x.checked_mul(y).and_then(|area| area.checked_mul(z));
        match count {
            Some(0) => Err(decoder.invalid(format!(
                "entry point `{}`: a workgroup of {x} x {y} x {z} invocations",
                entry.name
            ))),
            Some(1..=MAX_INVOCATIONS) => {
                Ok(Self { size: [x as u32, y as u32, z as u32], memory: decoder.workgroup_size })
            }
            _ => Err(decoder.unsupported(format!(
                "entry point `{}`: a workgroup of {x} x {y} x {z} invocations; at most {MAX_INVOCATIONS} run here",
                entry.name
            ))),
        }
    }
}
