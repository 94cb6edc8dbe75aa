//! The entry of a source in a scene that is written, with what the command line says of it.

use std::path::Path;

use crate::init::relative;
use anyhit_base::error::Result;
use anyhit_compile::{LanguageName, STAGE_NAMES, SourceWords};

/// The table of a source, in one line.
pub(super) fn table(file: &str, words: &SourceWords, folder: &Path) -> Result<String> {
    let mut keys = vec![format!("source = {file:?}")];
    let list = |words: &[String]| format!("{words:?}");
    if let Some((name, _)) = LanguageName::NAMES.iter().find(|(_, one)| Some(*one) == words.language) {
        keys.push(format!("language = \"{name}\""));
    }
    if let Some((name, _)) = STAGE_NAMES.iter().find(|(_, one)| Some(*one) == words.stage) {
        keys.push(format!("stage = \"{name}\""));
    }
    if let Some(entry) = &words.entry {
        keys.push(format!("entry = {entry:?}"));
    }
    if !words.include_folders.is_empty() {
        let folders = words.include_folders.iter().map(|include| relative(include, folder));
        keys.push(format!("include_folders = {}", list(&folders.collect::<Result<Vec<_>>>()?)));
    }
    if !words.flags.is_empty() {
        keys.push(format!("compiler_flags = {}", list(&words.flags)));
    }
    Ok(format!("{{ {} }}", keys.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_says_of_a_source_what_the_command_line_does() {
        let folder = tempfile::tempdir().unwrap();
        let shaders = folder.path().join("shaders");
        std::fs::create_dir_all(shaders.join("common")).unwrap();
        let words = SourceWords {
            language: Some(LanguageName::Hlsl),
            stage: Some(anyhit_engine::module::interface::Stage::ClosestHit),
            entry: Some("hit".into()),
            include_folders: vec![shaders.join("common")],
            flags: vec!["-fvk-t-shift".into(), "10".into(), "0".into()],
        };
        assert_eq!(
            table("shaders/a.rchit", &words, folder.path()).unwrap(),
            "{ source = \"shaders/a.rchit\", language = \"hlsl\", stage = \"closest_hit\", entry = \"hit\", \
             include_folders = [\"shaders/common\"], compiler_flags = [\"-fvk-t-shift\", \"10\", \"0\"] }"
        );
    }
}
