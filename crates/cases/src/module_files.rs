//! The files that a scene's shaders come from.

use anyhit_base::escape;
use anyhit_engine::machine::ShaderIndex;
use anyhit_explain::names::Names;
use anyhit_scene::files::normalise;
use anyhit_scene::{Assembled, ResolvedScene};

/// Returns the file of each shader, in the order of [`Assembled::programs`]: its module or source,
/// or its stage and entry point if the scene names no file.
pub(crate) fn module_files(scene: &ResolvedScene, assembled: &Assembled) -> Vec<String> {
    let pipelines = assembled.all_pipelines().flat_map(|(index, pipeline)| {
        let names = Names::new(scene, index, pipeline);
        let path = move |at| names.module(ShaderIndex::new(at)).map(|module| module.path.to_path_buf());
        (0..pipeline.programs.len()).map(path)
    });
    // A dispatch of a test has a module without a file.
    let path = |module: usize| scene.shaders.get(module).map(|shader| shader.path.clone());
    let dispatched = scene.dispatches.iter().map(|entry| path(entry.shader.module));
    let paths = pipelines.chain(dispatched).zip(assembled.programs());
    let shown = paths.map(|(path, program)| match path {
        Some(path) => escape::path(&normalise(&path)).to_string(),
        None => format!("{} `{}`", program.stage.name(), program.name),
    });
    shown.collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn a_path_goes_straight_to_its_file() {
        for (path, straight) in [
            ("shaders/a/../../fixtures/a.spv", "fixtures/a.spv"),
            ("../a/./b/../c.spv", "../a/c.spv"),
            ("a/../../b.spv", "../b.spv"),
            ("/a/../b.spv", "/b.spv"),
        ] {
            assert_eq!(normalise(Path::new(path)), Path::new(straight), "{path}");
        }
    }
}
