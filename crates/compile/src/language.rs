//! The languages and stages of sources, by file extension or by name.

use std::path::Path;

use anyhit_base::error::Stage;
use anyhit_base::error::{Error, ErrorKind};

/// The extensions that are known.
pub const EXTENSIONS: &str = "GLSL: .rgen .rint .rahit .rchit .rmiss .rcall .comp, optionally followed by .glsl; WGSL: .wgsl; Slang: .slang; HLSL: .hlsl";

/// The stages that sources have, by the words of scenes and of the command line.
pub const STAGE_NAMES: [(&str, Stage); 7] = [
    ("raygen", Stage::RayGeneration),
    ("intersection", Stage::Intersection),
    ("any_hit", Stage::AnyHit),
    ("closest_hit", Stage::ClosestHit),
    ("miss", Stage::Miss),
    ("callable", Stage::Callable),
    ("compute", Stage::Compute),
];

/// The file extension, without a dot, that glslang knows a stage by.
pub(super) fn extension(stage: Stage) -> Option<&'static str> {
    Some(match stage {
        Stage::RayGeneration => "rgen",
        Stage::Intersection => "rint",
        Stage::AnyHit => "rahit",
        Stage::ClosestHit => "rchit",
        Stage::Miss => "rmiss",
        Stage::Callable => "rcall",
        Stage::Compute => "comp",
        Stage::Other(_) => return None,
    })
}

/// The error for a stage that no source of this crate has.
pub(super) fn unknown_stage(stage: Stage) -> Error {
    let text = format!("a source must be a ray-tracing or compute shader, not {}", stage.name());
    Error::new(ErrorKind::InvalidArgument, text)
}

/// The name of a language, where a file's extension does not say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LanguageName {
    /// GLSL, whose stage is said as well.
    Glsl,
    /// HLSL, compiled by slangc.
    Hlsl,
    /// Slang, compiled by slangc.
    Slang,
    /// WGSL, compiled by naga.
    Wgsl,
}

impl LanguageName {
    /// The languages by the words of scenes and of the command line.
    pub const NAMES: [(&'static str, Self); 4] =
        [("glsl", Self::Glsl), ("hlsl", Self::Hlsl), ("slang", Self::Slang), ("wgsl", Self::Wgsl)];
}

/// The language of a source, known by its file extension or said beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Language {
    /// GLSL: one stage a file, entry point `main`.
    Glsl(Stage),
    /// WGSL (`.wgsl`), with naga's ray-tracing extensions.
    Wgsl,
    /// Slang (`.slang`).
    Slang,
    /// HLSL (`.hlsl`).
    Hlsl,
}

impl Language {
    /// The language of a file name, by its extension; `None` for headers and everything else.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let stage = |name: &str| {
            STAGE_NAMES.into_iter().map(|(_, stage)| stage).find(|&stage| extension(stage) == Some(name))
        };
        Some(match path.extension()?.to_str()? {
            "wgsl" => Self::Wgsl,
            "slang" => Self::Slang,
            "hlsl" => Self::Hlsl,
            // `a.rchit.glsl`; a plain `.glsl` is a header.
            "glsl" => Self::Glsl(stage(Path::new(path.file_stem()?).extension()?.to_str()?)?),
            other => Self::Glsl(stage(other)?),
        })
    }

    /// The language of a file by what is said of it, else by its extension; `None` where neither
    /// says it.
    ///
    /// # Errors
    /// A message where what is said makes no sense: GLSL of no stage, WGSL of one.
    #[doc(hidden)]
    pub fn said(
        name: Option<LanguageName>,
        stage: Option<Stage>,
        path: &Path,
    ) -> Result<Option<Self>, String> {
        let by_extension = Self::of(path);
        let is_glsl = path.extension().is_some_and(|extension| extension == "glsl");
        let language = match (name, by_extension, stage) {
            (Some(LanguageName::Glsl), _, Some(stage)) => Self::Glsl(stage),
            (Some(LanguageName::Glsl), Some(glsl @ Self::Glsl(_)), None) => glsl,
            (Some(LanguageName::Glsl), _, None) => {
                return Err("the name of the GLSL source does not identify its stage: set `stage`".to_owned());
            }
            (Some(LanguageName::Hlsl), ..) => Self::Hlsl,
            (Some(LanguageName::Slang), ..) => Self::Slang,
            (Some(LanguageName::Wgsl), ..) => Self::Wgsl,
            (None, Some(Self::Glsl(_)), Some(stage)) => Self::Glsl(stage),
            (None, None, Some(stage)) if is_glsl => Self::Glsl(stage),
            (None, Some(language), _) => language,
            (None, None, _) => return Ok(None),
        };
        if language == Self::Wgsl && stage.is_some() {
            return Err("a WGSL source declares the stages of its entry points: remove `stage`".to_owned());
        }
        Ok(Some(language))
    }

    /// Whether `slangc` compiles it.
    pub(crate) fn is_slang_or_hlsl(self) -> bool {
        matches!(self, Self::Slang | Self::Hlsl)
    }
}

/// The error for a file whose language nothing says.
pub(crate) fn unknown_language(name: &str) -> Error {
    let error =
        Error::new(ErrorKind::InvalidArgument, format!("`{name}`: the extension names no shader language"));
    let error = error.note(EXTENSIONS);
    if name.ends_with(".glsl") {
        error.note("help: for a plain .glsl file, set `stage` of the shader in a scene, or `--stage` on the command line")
    } else {
        error.note(
            "help: set `language` (and `stage`) of the shader in a scene, or `--language` on the command line",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_tell_language_and_stage() {
        let of = |name: &str| Language::of(Path::new(name));
        assert_eq!(of("a.rchit"), Some(Language::Glsl(Stage::ClosestHit)));
        assert_eq!(of("a.rmiss.glsl"), Some(Language::Glsl(Stage::Miss)));
        assert_eq!(of("a.hlsl"), Some(Language::Hlsl));
        assert_eq!(of("common.glsl"), None);
        assert_eq!(of("a.rchit.spv"), None);
    }

    #[test]
    fn what_is_said_goes_before_the_extension() {
        use LanguageName as Name;
        let miss = Some(Stage::Miss);
        let said = |name, stage, path: &str| Language::said(name, stage, Path::new(path));
        for (name, stage, path, expected) in [
            (None, None, "a.glsl", None),
            (None, miss, "a.glsl", Some(Language::Glsl(Stage::Miss))),
            (None, miss, "a.rchit", Some(Language::Glsl(Stage::Miss))),
            (None, miss, "a.txt", None),
            (None, miss, "a.hlsl", Some(Language::Hlsl)),
            (Some(Name::Hlsl), None, "a.rchit", Some(Language::Hlsl)),
            (Some(Name::Slang), miss, "a.txt", Some(Language::Slang)),
            (Some(Name::Glsl), None, "a.rchit.glsl", Some(Language::Glsl(Stage::ClosestHit))),
            (Some(Name::Glsl), miss, "a.slang", Some(Language::Glsl(Stage::Miss))),
            (Some(Name::Wgsl), None, "a.txt", Some(Language::Wgsl)),
        ] {
            assert_eq!(said(name, stage, path), Ok(expected), "{name:?} {stage:?} {path}");
        }
        assert!(said(Some(Name::Glsl), None, "a.glsl").unwrap_err().contains("set `stage`"));
        assert!(said(None, miss, "a.wgsl").unwrap_err().contains("remove `stage`"));
    }

    #[test]
    fn a_file_of_no_language_tells_how_to_say_it() {
        assert!(unknown_language("common.glsl").render().contains("for a plain .glsl file, set `stage`"));
        assert!(unknown_language("a.txt").render().contains("`--language`"));
    }
}
