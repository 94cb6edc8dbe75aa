//! How many workgroups a compute shader is dispatched in: several along the axes that it asks for.

use crate::module::Module;
use crate::module::dispatch_axes::axes_read;

/// Workgroups of a compute shader, along each axis that it asks for.
const GROUPS: [u32; 3] = [2, 2, 1];
/// Invocations of a workgroup that is dispatched once only.
const LARGE: u64 = 1024;

/// The workgroups of a dispatch: several of small ones, where several are wanted, along the axes of
/// which the shader reads where in the dispatch an invocation stands. Workgroups side by side along
/// another axis would all do the same, and race.
pub(super) fn groups(module: &Module, size: [u32; 3], several: bool) -> [u32; 3] {
    let each = size.iter().map(|&side| u64::from(side)).product::<u64>();
    if !several || each > LARGE {
        return [1; 3];
    }
    let read = axes_read(module);
    [0, 1, 2].map(|axis| if read[axis] { GROUPS[axis] } else { 1 })
}
