//! Copies of resources, so that a run leaves what it was given as it was.
//!
//! A run copies the memory that its shaders may write, and shares the rest. Nobody writes to memory
//! that an outcome or a scene holds: the next run copies it again, so that both may keep it.

use std::borrow::Cow;
use std::sync::Arc;

use anyhit_engine::machine::{Buffer, Resources};
use anyhit_engine::pipeline::{Pipeline, SbtRecord, WrittenMemory, once};

/// Copies resources with all of their memory, for runs in which not only shaders write: a debugger
/// sets variables.
pub fn copied(resources: &Resources) -> Resources {
    WrittenMemory::everything().copied(resources)
}

/// A pipeline and resources to run it on: what its shaders may write is copied, the rest shared.
pub(super) fn copied_for_run<'p>(
    pipeline: &'p Pipeline,
    resources: &Resources,
) -> (Cow<'p, Pipeline>, Resources) {
    let written = WrittenMemory::of(&pipeline.programs, resources);
    let has_addresses = || pipeline.programs.iter().any(|program| program.addresses_records);
    let pipeline = match written.reaches_addresses() && has_addresses() {
        true => Cow::Owned(with_own_records(pipeline)),
        false => Cow::Borrowed(pipeline),
    };
    (pipeline, written.copied(resources))
}

/// A pipeline with copies of the shader records that have device addresses.
fn with_own_records(pipeline: &Pipeline) -> Pipeline {
    let mut own = pipeline.clone();
    let mut copies: Vec<(Arc<Buffer>, Arc<Buffer>)> = Vec::new();
    let records = own.sbt.hit.iter_mut().chain(&mut own.sbt.miss).flatten();
    for data in records.filter_map(|record: &mut SbtRecord| record.data.as_mut()) {
        *data = once(&mut copies, &*data, || Buffer::new(&data.bytes()));
    }
    own
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::machine::Descriptor;
    use anyhit_engine::pipeline::RunOptions;
    use anyhit_scene::{LoadOptions, SceneFiles, assemble, load};

    /// Runs the passes of a scene on a copy of everything, and returns how many buffers and images
    /// no shader can write by the analysis.
    ///
    /// # Panics
    /// Where one of these is not as it was.
    fn unwritten(path: &std::path::Path) -> usize {
        let (files, options) = (SceneFiles::default(), LoadOptions::default());
        let Ok(assembled) = load(path, &files, &options).and_then(|scene| assemble(&scene)) else { return 0 };
        if assembled.invocations() > 2048 {
            return 0;
        }
        let resources = copied(&assembled.resources);
        let written = assembled.written_memory(&resources);
        // Some of them trap.
        let _ = assembled.run(&resources, RunOptions::default());
        let kinds = |resources: &Resources| {
            let descriptors = resources.descriptors.values().flatten();
            let bound = descriptors.flat_map(|one| one.kinds().to_vec()).collect::<Vec<_>>();
            let addressed = resources.memory.buffers().cloned().map(Descriptor::Buffer);
            bound.into_iter().chain(addressed).collect::<Vec<_>>()
        };
        let mut count = 0;
        for (after, before) in kinds(&resources).iter().zip(kinds(&assembled.resources)) {
            let (is_written, is_same) = match (after, &before) {
                (Descriptor::Buffer(after), Descriptor::Buffer(before)) => {
                    (written.contains_buffer(after), after.bytes() == before.bytes())
                }
                (
                    Descriptor::Image(after) | Descriptor::ImageSampler(after, _),
                    Descriptor::Image(before) | Descriptor::ImageSampler(before, _),
                ) => (written.contains_image(after), after.is_like(&before.state())),
                _ => continue,
            };
            if !is_written {
                assert!(is_same, "{path:?}: {before:?} was written");
                count += 1;
            }
        }
        count
    }

    #[test]
    fn memory_that_no_shader_can_write_stays_in_the_cases() {
        let mut folders =
            vec![std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("shaders/pass")];
        let mut count = 0;
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).expect("a folder") {
                let path = entry.expect("an entry").path();
                match path.extension() {
                    _ if path.is_dir() => folders.push(path),
                    Some(extension) if extension == "toml" => count += unwritten(&path),
                    _ => {}
                }
            }
        }
        assert!(count > 40, "only {count} buffers and images are not written");
    }
}
