//! Launches under the sanitizer on all threads.
//!
//! A report depends on the order of invocations: it names the first one that breaks a rule, and the
//! first cause of a value. Threads therefore share a launch only until one of them has a finding.
//! Each thread keeps its own record. After a finding, the memory is restored, and the launch runs
//! again in launch order on one thread. Without findings, both orders report nothing, because no
//! invocation accesses memory that another one writes.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

use anyhit_debugger::debugger::memory_state::ChangingMemory;
use anyhit_engine::ops::op::Op;
use anyhit_engine::pipeline::observed_launch::ObservedTask;
use anyhit_engine::pipeline::{Launch, Stats, WrittenMemory};
use anyhit_sanitize::{Levels, PausedRayWatch, ProgramPlan, RayWatch, Sanitizer, SeenRays, UnwrittenMemory};
use anyhit_scene::ResolvedScene;

/// A launch that may have no findings.
pub(super) struct CleanLaunch<'a> {
    pub scene: &'a ResolvedScene,
    pub launch: &'a Launch<'a>,
    pub plans: &'a [ProgramPlan],
    pub levels: &'a Levels,
}

/// The result of a launch without findings.
pub(super) struct CleanRun {
    pub stats: Stats,
    pub unwritten: UnwrittenMemory,
    pub seen: SeenRays,
}

/// The record of one thread: its sanitizer, and the rays of its tasks.
struct Record<'a> {
    sanitizer: Sanitizer<'a>,
    watch: PausedRayWatch,
    /// The rays of each task, by its place in launch order.
    seen: Vec<(u64, SeenRays)>,
}

impl CleanLaunch<'_> {
    /// Runs the launch on all threads. Returns `None` if it must run on one thread: after a finding
    /// or a trap, which leave the memory as it was, or if its invocations depend on their order.
    /// `unwritten` and `seen` are the records before the launch.
    pub(super) fn run(
        &self,
        size: [u32; 3],
        unwritten: &UnwrittenMemory,
        seen: &SeenRays,
    ) -> Option<CleanRun> {
        let Self { scene, launch, plans, levels } = self;
        let (pipeline, resources) = (launch.pipeline, launch.resources);
        // The order of atomic instructions and of printed lines is that of one thread.
        let is_ordered = |op: &Op| matches!(op, Op::Atomic(_) | Op::Print(_));
        let written = WrittenMemory::of(&pipeline.programs, resources);
        if plans.iter().any(|plan| plan.program.ops.iter().any(is_ordered))
            || written.reaches_addresses()
            || !launch.is_observed_on_threads(size)
        {
            return None;
        }
        let memory = ChangingMemory::of_written(&written, resources);
        let before = memory.state(None);
        let new_record = || Record {
            sanitizer: Sanitizer::new(plans, levels)
                .of_pipeline(pipeline)
                .with_unwritten(unwritten.clone())
                .with_resources(resources),
            watch: PausedRayWatch::default(),
            seen: Vec::new(),
        };
        let records: Mutex<Vec<Record<'_>>> = Mutex::default();
        let is_found = AtomicBool::new(false);
        let observe = |range: Range<u64>, run: &mut ObservedTask<'_>| {
            if is_found.load(Relaxed) {
                return;
            }
            let idle = records.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut record = idle.unwrap_or_else(new_record);
            let mut own = SeenRays::default();
            record.sanitizer.begin_part(range.start);
            let paused = std::mem::take(&mut record.watch);
            let mut watch = RayWatch::of_paused(pipeline, *scene, levels, &mut own, paused);
            run(&mut watch, &mut record.sanitizer);
            record.watch = watch.pause();
            record.seen.push((range.start, own));
            if !record.sanitizer.findings().is_empty() || !record.watch.findings().is_empty() {
                is_found.store(true, Relaxed);
            }
            records.lock().unwrap_or_else(PoisonError::into_inner).push(record);
        };
        let outcome = launch.run_observed_on_threads(size, &observe);
        let records = records.into_inner().unwrap_or_else(PoisonError::into_inner);
        let found = outcome.ok().filter(|_| !is_found.into_inner());
        let clean = found.and_then(|stats| self.joined(stats, records, seen));
        if clean.is_none() {
            memory.restore(&before);
        }
        clean
    }

    /// Merges the records of all threads. Returns `None` if the merged record has findings.
    fn joined(&self, stats: Stats, records: Vec<Record<'_>>, seen: &SeenRays) -> Option<CleanRun> {
        let mut sanitizers = Vec::new();
        let mut tasks = Vec::new();
        for record in records {
            sanitizers.push(record.sanitizer);
            tasks.extend(record.seen);
        }
        tasks.sort_unstable_by_key(|(place, _)| *place);
        let mut seen = seen.clone();
        tasks.iter().for_each(|(_, rays)| seen.merge(rays));
        let merged = sanitizers.into_iter().reduce(|mut all, one| {
            all.merge(one);
            all
        })?;
        let (findings, unwritten) = merged.into_findings_and_unwritten();
        let watch = RayWatch::new(self.launch.pipeline, self.scene, self.levels, &mut seen);
        let is_clean = findings.is_empty() && watch.into_findings_of_launch().is_empty();
        is_clean.then_some(CleanRun { stats, unwritten, seen })
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::sanitized::run_sanitized;
    use anyhit_engine::machine::{Descriptor, Resources};
    use anyhit_sanitize::Findings;
    use anyhit_scene::sanitize_table::scene_levels;
    use anyhit_scene::{Assembled, DiskFiles, LoadOptions, assemble, load_text};

    fn on_threads<R: Send>(count: usize, run: impl FnOnce() -> R + Send) -> R {
        rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a pool").install(run)
    }

    /// The scenes of the sanitizer's cases, and the built-in one.
    fn scenes() -> Vec<PathBuf> {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        let folders = std::fs::read_dir(root.join("shaders/sanitize")).expect("the cases");
        let files =
            folders.flat_map(|folder| std::fs::read_dir(folder.expect("a folder").path()).into_iter());
        let mut scenes: Vec<PathBuf> = files.flatten().map(|file| file.expect("a file").path()).collect();
        scenes.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
        scenes.push(root.join("scenes/swept-spheres.toml"));
        scenes.sort_unstable();
        scenes
    }

    /// A scene with a launch and with buffers that are large enough for several threads; `None`
    /// where it has no launch, or cannot be larger.
    fn enlarged(path: &Path) -> Option<(ResolvedScene, Assembled)> {
        let text = std::fs::read_to_string(path).expect("a scene");
        let mut lines: Vec<String> = Vec::new();
        for line in text.lines() {
            let number = line.strip_prefix("size = ").and_then(|size| size.parse::<u32>().ok());
            lines.push(match number {
                Some(size) => format!("size = {}", size * 512),
                None => line.into(),
            });
        }
        let options = LoadOptions { size: Some([64, 32]), ..LoadOptions::default() };
        let scene = load_text(path, &lines.join("\n"), &DiskFiles, &options).ok()?;
        let assembled = assemble(&scene).ok()?;
        (scene.launch == [64, 32, 1]).then_some((scene, assembled))
    }

    fn told(findings: &Findings) -> String {
        findings.iter().map(|finding| format!("{}\n{:?}\n", finding.render(), finding.record())).collect()
    }

    /// The content of all buffers and images.
    fn contents(resources: &Resources) -> Vec<Vec<u8>> {
        let kinds = resources.descriptors.values().flatten().flat_map(Descriptor::kinds);
        let bytes = kinds.filter_map(|descriptor| match descriptor {
            Descriptor::Buffer(buffer) => {
                Some(buffer.words().iter().flat_map(|word| word.load(Relaxed).to_le_bytes()).collect())
            }
            Descriptor::Image(image) => Some(image.bytes().to_vec()),
            _ => None,
        });
        bytes.collect()
    }

    #[test]
    fn reports_do_not_depend_on_the_number_of_threads() {
        let (mut clean, mut all) = (0, 0);
        for path in scenes() {
            let run = |threads: usize| {
                let (scene, assembled) = enlarged(&path)?;
                let levels = scene_levels(&scene.document).expect("levels");
                let resources = &assembled.resources;
                let run = on_threads(threads, || run_sanitized(&scene, &assembled, resources, &levels));
                let run = run.expect("a run");
                let outcome = run.outcome.map(|stats| format!("{stats:?}")).map_err(|error| error.render());
                Some((told(&run.findings), outcome, contents(resources)))
            };
            let Some(one) = run(1) else { continue };
            all += 1;
            clean += usize::from(one.0.is_empty());
            assert!(run(3).as_ref() == Some(&one), "{}:\n{}", path.display(), one.0);
        }
        assert!(clean > 10 && all > 60, "{clean} of {all}");
    }

    #[test]
    fn a_clean_launch_runs_on_threads() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("scenes/swept-spheres.toml");
        let (scene, assembled) = enlarged(&path).expect("a scene");
        let reference = assembled.for_sanitizer().expect("programs");
        let plans: Vec<_> = reference.pipeline.programs.iter().map(ProgramPlan::new).collect();
        let launch = Launch { pipeline: &reference.pipeline, resources: &reference.resources };
        let levels = Levels::default();
        let clean = CleanLaunch { scene: &scene, launch: &launch, plans: &plans, levels: &levels };
        let run = |threads| {
            on_threads(threads, || clean.run(scene.launch, &UnwrittenMemory::default(), &SeenRays::default()))
        };
        assert!(run(1).is_none());
        let of_three = run(3).expect("nothing is found");
        assert!(of_three.stats.rays >= 64 * 32);
        assert_eq!(of_three.seen.structures().count(), 1);
    }
}
