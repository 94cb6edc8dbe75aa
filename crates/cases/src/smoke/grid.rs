//! How many invocations a shader is launched over, or dispatched in workgroups: several along the
//! axes that it asks for.

use anyhit_engine::module::Module;
use anyhit_engine::module::dispatch_axes::{Grid, axes_read};

/// Invocations of a launch along each axis.
const LAUNCH: [u32; 3] = [8, 4, 1];
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
    let read = axes_read(module, Grid::Dispatch);
    [0, 1, 2].map(|axis| if read[axis] { GROUPS[axis] } else { 1 })
}

/// The invocations of a launch, given the axes of which its shader reads where an invocation
/// stands: as many along one axis as along two. Invocations that differ in another axis alone would
/// all do the same, and write the same memory.
pub(super) fn launch_size(read: [bool; 3]) -> [u32; 3] {
    let [width, height, depth] = LAUNCH;
    match read {
        [true, true, _] => LAUNCH,
        [true, false, _] => [width * height, 1, depth],
        [false, true, _] => [1, width * height, depth],
        [false, false, _] => [1; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invocations_lie_along_the_axes_that_are_asked_for() {
        let [no, yes] = [false, true];
        let sizes = [[yes; 3], [yes, yes, no], [yes, no, no], [no, yes, no], [no; 3]].map(launch_size);
        assert_eq!(sizes, [[8, 4, 1], [8, 4, 1], [32, 1, 1], [1, 32, 1], [1; 3]]);
    }
}
