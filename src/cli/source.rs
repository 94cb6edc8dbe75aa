//! What the command line says of shader sources: language, stage, entry point, folders and flags.

use std::path::PathBuf;

use clap::Args;

use anyhit_compile::{LanguageName, STAGE_NAMES, SourceWords};
use anyhit_engine::module::interface::Stage;

/// How sources are compiled that the command line names.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct SourceArgs {
    /// Language of sources whose extension does not identify it: glsl, hlsl, slang or wgsl
    #[arg(long, value_name = "LANGUAGE", value_parser = language)]
    language: Option<LanguageName>,
    /// Stage of a GLSL source whose name does not identify it, or of the single entry point to
    /// compile from Slang or HLSL: raygen, intersection, any_hit, closest_hit, miss, callable or
    /// compute
    #[arg(long, value_name = "STAGE", value_parser = stage)]
    stage: Option<Stage>,
    /// Compile one entry point of a Slang or HLSL source [default with --stage: main]
    #[arg(long, value_name = "NAME")]
    entry: Option<String>,
    /// Also search a folder for included files; may be repeated
    #[arg(short = 'I', value_name = "FOLDER")]
    include_folders: Vec<PathBuf>,
    /// Define a preprocessor macro; may be repeated
    #[arg(short = 'D', value_name = "NAME[=VALUE]")]
    defines: Vec<String>,
    /// Pass a flag to the compiler, as `compiler_flags` in a scene, with its values after spaces:
    /// `--flag "-fvk-t-shift 10 0"`; may be repeated
    #[arg(long = "flag", value_name = "FLAG", allow_hyphen_values = true)]
    flags: Vec<String>,
}

impl SourceArgs {
    /// What they say.
    pub(super) fn words(&self) -> SourceWords {
        let defines = self.defines.iter().map(|define| format!("-D{define}"));
        let mut given = self.flags.iter().flat_map(|flag| flag.split_whitespace());
        let (mut folders, mut flags) = (self.include_folders.clone(), Vec::new());
        // As `-I` beside `--flag`: what a scene would say of folders is relative to its own.
        while let Some(flag) = given.next() {
            match flag.strip_prefix("-I") {
                Some("") => folders.extend(given.next().map(PathBuf::from)),
                Some(folder) => folders.push(folder.into()),
                None => flags.push(flag.to_owned()),
            }
        }
        SourceWords {
            language: self.language,
            stage: self.stage,
            entry: self.entry.clone(),
            include_folders: folders,
            flags: defines.chain(flags).collect(),
        }
    }
}

fn language(text: &str) -> Result<LanguageName, String> {
    named(text, &LanguageName::NAMES)
}

fn stage(text: &str) -> Result<Stage, String> {
    named(text, &STAGE_NAMES)
}

fn named<T: Copy>(text: &str, names: &[(&str, T)]) -> Result<T, String> {
    let found = names.iter().find(|(name, _)| *name == text).map(|(_, found)| *found);
    let known = || names.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    found.ok_or_else(|| format!("expected one of: {}", known()))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        sources: SourceArgs,
    }

    fn parse(line: &[&str]) -> Option<SourceWords> {
        let line = std::iter::once("anyhit").chain(line.iter().copied());
        Command::try_parse_from(line).ok().map(|command| command.sources.words())
    }

    #[test]
    fn options_of_sources_become_words() {
        let line =
            ["--stage", "any_hit", "-I", "a", "-Ib", "-DX=1", "--flag", "-fvk-t-shift 10 0", "--flag=-Ic"];
        let words = parse(&line).unwrap();
        assert_eq!(words.stage, Some(Stage::AnyHit));
        assert_eq!(words.include_folders, ["a", "b", "c"].map(PathBuf::from));
        assert_eq!(words.flags, ["-DX=1", "-fvk-t-shift", "10", "0"]);
        assert_eq!(parse(&["--language", "hlsl"]).unwrap().language, Some(LanguageName::Hlsl));
        assert!(parse(&["--language", "cuda"]).is_none());
        assert!(parse(&["--stage", "rgen"]).is_none());
    }
}
