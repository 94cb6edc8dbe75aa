//! What `--stats` prints.

use std::time::Duration;

use crate::machine::Binding;
use crate::pipeline::Stats;
use crate::program::sharing::Memory;
use crate::scene::Assembled;

/// Rays, invocations, occupancy, times.
pub fn table(stats: &Stats, ready: Duration, traced: Duration) -> String {
    let rate = stats.rays as f64 / traced.as_secs_f64().max(1e-9) / 1e6;
    let mut text = format!(
        "scene ready in    {:>9.1} ms\nlaunch took       {:>9.1} ms\nrays              {:>9} ({rate:.2} million a second)\n",
        ready.as_secs_f64() * 1e3,
        traced.as_secs_f64() * 1e3,
        stats.rays,
    );
    if stats.ray_queries > 0 {
        let rate = stats.ray_queries as f64 / traced.as_secs_f64().max(1e-9) / 1e6;
        text += &format!("ray queries       {:>9} ({rate:.2} million a second)\n", stats.ray_queries);
    }
    for (stage, shader) in &stats.shaders {
        let lanes = shader.invocations as f64 / shader.batches.max(1) as f64;
        text += &format!(
            "{:<17} {:>9} invocations in {} batches, {lanes:.1} lanes each\n",
            stage.name(),
            shader.invocations,
            shader.batches
        );
    }
    text
}

/// Which shaders ran on one thread, and why; empty where none did.
pub fn order(assembled: &Assembled) -> String {
    let pipeline = assembled.pipeline.programs.iter();
    let dispatched = assembled.dispatches.iter().map(|dispatch| &dispatch.compute.program);
    let mut text = String::new();
    for program in pipeline.chain(dispatched).filter(|program| program.order_dependent) {
        text += &format!(
            "one thread, one invocation after the other: {} `{}` depends on their order (it uses what an atomic \
             returns, exchanges, or adds floats)\n",
            program.stage.name(),
            program.name
        );
    }
    if !assembled.pipeline.order_dependent()
        && let Some(memory) = assembled.pipeline.shared_memory(assembled.size, &assembled.resources)
    {
        text += &sharing("the launch's", memory);
    }
    for dispatch in &assembled.dispatches {
        let compute = &dispatch.compute;
        let memory = compute
            .shared_memory(dispatch.groups, &assembled.resources)
            .filter(|_| !compute.program.order_dependent);
        if let Some(memory) = memory {
            text += &sharing(&format!("GLCompute `{}`'s", compute.program.name), memory);
        }
    }
    text
}

fn sharing(whose: &str, memory: Memory) -> String {
    let place = match memory {
        Memory::Binding(Binding { set, binding }) => format!("set {set}, binding {binding}"),
        Memory::Addresses => "memory behind device addresses".to_owned(),
        Memory::Unknown => "memory of a descriptor known only while running".to_owned(),
    };
    format!(
        "one thread, 32 invocations together in their order: {whose} invocations may reach each other's data in \
         {place}, without atomic instructions\n"
    )
}
