//! The tables of `--stats`.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

use anyhit_base::count::grouped;
use anyhit_base::escape;
use anyhit_base::sorted::{sort, sort_by_key};
use anyhit_engine::accel::{Blas, Tlas};
use anyhit_engine::machine::Descriptor;
use anyhit_engine::pipeline::{BandedLaunch, Stats};
use anyhit_engine::program::race_analysis::Memory;
use anyhit_scene::image_entry::ImageContent;
use anyhit_scene::pass::PassWork;
use anyhit_scene::resolved::UnreadPart;
use anyhit_scene::{Assembled, ResolvedScene};

/// The lines of `--stats` about rays, invocations, occupancy and times.
pub(super) fn table(stats: &Stats, load_time: Duration, launch_time: Duration) -> String {
    let rate = stats.rays as f64 / launch_time.as_secs_f64().max(1e-9) / 1e6;
    let mut text = format!(
        "scene ready in    {:>9.1} ms\nlaunch took       {:>9.1} ms\nrays              {:>9} ({rate:.2} million a second)\n",
        load_time.as_secs_f64() * 1e3,
        launch_time.as_secs_f64() * 1e3,
        grouped(stats.rays),
    );
    if stats.ray_queries > 0 {
        let rate = stats.ray_queries as f64 / launch_time.as_secs_f64().max(1e-9) / 1e6;
        text +=
            &format!("ray queries       {:>9} ({rate:.2} million a second)\n", grouped(stats.ray_queries));
    }
    if stats.zero_directions > 0 {
        text += &format!(
            "zero directions   {:>9} rays with direction 0, which hit no triangle, sphere or swept sphere\n",
            grouped(stats.zero_directions)
        );
    }
    for (stage, shader) in &stats.shaders {
        let lanes = shader.invocations as f64 / shader.batches.max(1) as f64;
        text += &format!(
            "{:<17} {:>9} invocations in {} batches, {lanes:.1} lanes each\n",
            stage.name(),
            grouped(shader.invocations),
            grouped(shader.batches)
        );
    }
    text
}

/// The lines of `--stats` about shaders that ran on one thread, with the reason.
pub(super) fn single_threaded(assembled: &Assembled) -> String {
    let mut text = String::new();
    for program in assembled.programs().filter(|program| program.order_dependent) {
        text += &format!(
            "one thread, one invocation at a time: {} `{}` depends on their order (it uses the result of an \
             atomic, exchanges, or adds floats)\n",
            program.stage.name(),
            program.name
        );
    }
    let is_frame = assembled.is_frame();
    for (number, pass) in assembled.passes.iter().enumerate() {
        let resources = assembled.pass_resources(pass, &assembled.resources);
        let (memory, owner) = match &pass.work {
            PassWork::Launch(launch) => {
                let pipeline = assembled.pipeline_at(launch.pipeline);
                let ordered = pipeline.order_dependent();
                let memory = pipeline.shared_memory(launch.size(&resources), &resources).filter(|_| !ordered);
                let owner = match is_frame {
                    true => format!("the launch's of pass {}", pass.label(number)),
                    false => "the launch's".to_owned(),
                };
                (memory, owner)
            }
            PassWork::Dispatch(index) => {
                let dispatch = &assembled.dispatches[*index];
                let (compute, groups) = (&dispatch.compute, dispatch.groups(&resources));
                let ordered = compute.program.order_dependent;
                let memory = compute.shared_memory(groups, &resources).filter(|_| !ordered);
                (memory, format!("GLCompute `{}`'s", compute.program.name))
            }
        };
        text += &memory.map_or_else(String::new, |memory| shared_memory_line(&owner, memory));
    }
    text
}

/// The lines of `--stats` about files and contents of models that were not read, or not decoded.
pub(super) fn unread(scene: &ResolvedScene, assembled: &Assembled) -> String {
    let mut text = String::new();
    for UnreadPart { what, files, reason, .. } in &scene.unread {
        const SHOWN: usize = 3;
        let mut names: Vec<_> = files.iter().take(SHOWN).map(|file| escape::line(file)).collect();
        if files.len() > SHOWN {
            names.push(format!("{} more", grouped(files.len() - SHOWN)).into());
        }
        let files = if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) };
        text += &format!("not read: {what}{files}: {reason}\n");
    }
    for contents in &scene.unread_contents {
        text += &format!("{contents}\n");
    }
    let descriptors = assembled.resources.descriptors.values().flatten().flat_map(Descriptor::kinds);
    let images = descriptors.filter_map(|kind| match kind {
        Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => Some(image),
        _ => None,
    });
    let unread: HashSet<_> = images.filter(|image| !image.is_read()).map(Arc::as_ptr).collect();
    match unread.len() {
        0 => {}
        1 => text += "not decoded: 1 image, of which no shader read a texel\n",
        count => {
            text += &format!("not decoded: {} images, of which no shader read a texel\n", grouped(count));
        }
    }
    text
}

/// The line of `--stats` about an image that was streamed in bands.
pub(super) fn bands(bands: &BandedLaunch<'_>, image: &ImageContent) -> String {
    let rows = bands.max_band_rows();
    let bytes = image.size() / u64::from(image.shape.extent[1]) * u64::from(rows);
    format!(
        "streamed          {:>9} bands of {rows} rows, {:.1} MiB each instead of {:.1} MiB for the image\n",
        grouped(bands.count()),
        bytes as f64 / f64::from(1 << 20),
        image.size() as f64 / f64::from(1 << 20),
    )
}

fn shared_memory_line(owner: &str, memory: Memory) -> String {
    let place = match memory {
        Memory::Binding(binding) => binding.to_string(),
        Memory::Addresses => "memory behind device addresses".to_owned(),
        Memory::Unknown => "memory of a descriptor that is known only at run time".to_owned(),
    };
    format!(
        "one thread, 64 invocations at a time, in order: {owner} invocations may access each other's data in \
         {place} by more than commutative atomics\n"
    )
}

/// The lines of `--stats` about elided and eliminated work, which nothing depends on.
pub(super) fn elided(stats: &Stats, assembled: &Assembled) -> String {
    let descriptors = assembled.resources.descriptors.values().flatten();
    let mut structures: Vec<&Arc<Tlas>> = Vec::new();
    for descriptor in descriptors {
        if let Descriptor::AccelerationStructure(tlas) = descriptor
            && !structures.iter().any(|known| Arc::ptr_eq(known, tlas))
        {
            structures.push(tlas);
        }
    }
    let instances: Vec<_> = structures.iter().flat_map(|tlas| tlas.instances()).collect();
    let mut blases: Vec<_> = instances.iter().map(|instance| &instance.blas).collect();
    sort_by_key(&mut blases, |blas| Arc::as_ptr(blas));
    blases.dedup_by(|one, other| Arc::ptr_eq(one, other));
    let mut text = String::new();
    if !instances.is_empty() {
        let mut kinds: Vec<String> = Vec::new();
        for kind in blases.iter().filter_map(|blas| blas.kind()).map(|kind| kind.to_string()) {
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        sort(&mut kinds);
        let number = |which: fn(&Blas) -> bool| blases.iter().filter(|blas| which(blas)).count();
        let (built, trees) = (number(Blas::is_built), number(Blas::has_bvh));
        let listed = match number(Blas::is_listed) {
            0 => String::new(),
            listed => format!(", {} as a list for a few rays", grouped(listed)),
        };
        text += &format!(
            "structures        {:>9} of {} were reached by rays and built, {} with a tree{listed} ({})\n",
            grouped(built),
            grouped(blases.len()),
            grouped(trees),
            kinds.join(", ")
        );
        let untransformed = instances.iter().filter(|instance| instance.is_identity()).count();
        text += &format!(
            "not transformed   {:>9} of {} instances\n",
            grouped(untransformed),
            grouped(instances.len())
        );
    }
    let elided = stats.elided;
    let rows = [
        (elided.any_hit, "any-hit invocations for closest hits on opaque geometry"),
        (elided.occlusion, "occlusion rays that ended at the first hit found"),
        (elided.empty, "invocations of shaders without effect"),
        (elided.unread, "invocations of shaders that write only payload words that are never read"),
    ];
    for (count, what) in rows.iter().filter(|(count, _)| *count > 0) {
        text += &format!("elided            {:>9} {what}\n", grouped(count));
    }
    let (mut operations, mut builtins, mut kept) = (0, 0, 0);
    for program in assembled.programs() {
        operations += program.eliminated.operations;
        builtins += program.eliminated.builtins;
        kept += program.ops.len();
    }
    text + &format!(
        "eliminated        {:>9} of {} operations and {} builtins that no output depends on\n",
        grouped(operations),
        grouped(operations as usize + kept),
        grouped(builtins)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_go_nowhere_are_told_where_there_are_some() {
        let told = |zero_directions: u64| {
            let stats = Stats { rays: 9, zero_directions, ..Stats::default() };
            table(&stats, Duration::ZERO, Duration::from_secs(1))
        };
        let line = "zero directions           4 rays with direction 0, which hit no triangle, sphere or swept sphere\n";
        assert!(told(4).contains(line), "{}", told(4));
        assert!(!told(0).contains("zero directions"));
    }
}
