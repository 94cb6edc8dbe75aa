//! Runs the invocations of a launch one by one, on all threads.

use anyhit_base::threads::map_on_threads;
use anyhit_engine::pipeline::Launch;

/// Runs the invocations of a launch in tasks on all threads: in ranges of 256 consecutive launch
/// indices, or in one task where shaders depend on the order of invocations or share memory. A
/// task is given its number and the launch ids of its invocations; the results are in the tasks'
/// order.
pub(super) fn in_tasks<T: Send>(
    launch: &Launch<'_>,
    size: [u32; 3],
    task: impl Fn(u64, &mut dyn Iterator<Item = [u32; 3]>) -> T + Sync,
) -> Vec<T> {
    const INVOCATIONS: u64 = 256;
    let [width, height, depth] = size.map(u64::from);
    let id =
        |index: u64| [index % width, index / width % height, index / width / height].map(|axis| axis as u32);
    let count = width * height * depth;
    let ordered =
        launch.pipeline.order_dependent() || launch.pipeline.shared_memory(size, launch.resources).is_some();
    if ordered {
        return vec![task(0, &mut (0..count).map(id))];
    }
    let range = |number: u64| number * INVOCATIONS..count.min((number + 1) * INVOCATIONS);
    let task = |number: usize| task(number as u64, &mut range(number as u64).map(id));
    map_on_threads(count.div_ceil(INVOCATIONS) as usize, task)
}
