//! The languages and stages of sources, by file extension or by name.

use std::path::Path;

use crate::error::{Error, ErrorKind};

/// The extensions that are known.
pub const EXTENSIONS: &str = "GLSL: .rgen .rint .rahit .rchit .rmiss .rcall .comp, also with .glsl behind; WGSL: .wgsl; Slang: .slang; HLSL: .hlsl";

/// A pipeline stage, named by the file extension that glslang knows it by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SourceStage {
    /// `.rgen`
    RayGeneration,
    /// `.rint`
    Intersection,
    /// `.rahit`
    AnyHit,
    /// `.rchit`
    ClosestHit,
    /// `.rmiss`
    Miss,
    /// `.rcall`
    Callable,
    /// `.comp`
    Compute,
}

impl SourceStage {
    const ALL: [Self; 7] = [
        Self::RayGeneration,
        Self::Intersection,
        Self::AnyHit,
        Self::ClosestHit,
        Self::Miss,
        Self::Callable,
        Self::Compute,
    ];

    /// The stages by the words of scenes and of the command line.
    pub const NAMES: [(&'static str, Self); 7] = [
        ("raygen", Self::RayGeneration),
        ("intersection", Self::Intersection),
        ("any_hit", Self::AnyHit),
        ("closest_hit", Self::ClosestHit),
        ("miss", Self::Miss),
        ("callable", Self::Callable),
        ("compute", Self::Compute),
    ];

    /// What slangc calls it.
    pub(super) fn slang_name(self) -> &'static str {
        match self {
            Self::RayGeneration => "raygeneration",
            Self::Intersection => "intersection",
            Self::AnyHit => "anyhit",
            Self::ClosestHit => "closesthit",
            Self::Miss => "miss",
            Self::Callable => "callable",
            Self::Compute => "compute",
        }
    }

    /// The file extension, without a dot.
    pub(super) fn extension(self) -> &'static str {
        match self {
            Self::RayGeneration => "rgen",
            Self::Intersection => "rint",
            Self::AnyHit => "rahit",
            Self::ClosestHit => "rchit",
            Self::Miss => "rmiss",
            Self::Callable => "rcall",
            Self::Compute => "comp",
        }
    }
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
pub enum Language {
    /// GLSL: one stage a file, entry point `main`.
    Glsl(SourceStage),
    /// WGSL (`.wgsl`), with naga's ray-tracing extensions.
    Wgsl,
    /// Slang (`.slang`).
    Slang,
    /// HLSL (`.hlsl`).
    Hlsl,
}

impl Language {
    /// The language of a file name, by its extension; `None` for headers and everything else.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        let stage = |name: &str| SourceStage::ALL.into_iter().find(|stage| stage.extension() == name);
        Some(match extension {
            "wgsl" => Self::Wgsl,
            "slang" => Self::Slang,
            "hlsl" => Self::Hlsl,
            // `a.rchit.glsl`; a plain `.glsl` is a header.
            "glsl" => Self::Glsl(stage(Path::new(path.file_stem()?).extension()?.to_str()?)?),
            extension => Self::Glsl(stage(extension)?),
        })
    }

    /// The language of a file by what is said of it, else by its extension; `None` where neither
    /// says it.
    ///
    /// # Errors
    /// A message where what is said makes no sense: GLSL of no stage, WGSL of one.
    pub fn said(
        name: Option<LanguageName>,
        stage: Option<SourceStage>,
        path: &Path,
    ) -> Result<Option<Self>, String> {
        let by_extension = Self::of(path);
        let is_glsl = path.extension().is_some_and(|extension| extension == "glsl");
        let language = match (name, by_extension, stage) {
            (Some(LanguageName::Glsl), _, Some(stage)) => Self::Glsl(stage),
            (Some(LanguageName::Glsl), Some(glsl @ Self::Glsl(_)), None) => glsl,
            (Some(LanguageName::Glsl), _, None) => {
                return Err(
                    "a GLSL source has one stage, which its name does not say: say the `stage`".to_owned()
                );
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
            return Err("a WGSL source says the stages of its entry points itself".to_owned());
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
        Error::new(ErrorKind::InvalidArgument, format!("`{name}`: the extension is of no shader language"));
    let error = error.note(EXTENSIONS);
    if name.ends_with(".glsl") {
        error.note("which stage a plain .glsl file is of: `stage` of the shader in a scene, `--stage` on the command line")
    } else {
        error.note(
            "or say it: `language` (and `stage`) of the shader in a scene, `--language` on the command line",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_tell_language_and_stage() {
        let of = |name: &str| Language::of(Path::new(name));
        assert_eq!(of("a.rchit"), Some(Language::Glsl(SourceStage::ClosestHit)));
        assert_eq!(of("a.rmiss.glsl"), Some(Language::Glsl(SourceStage::Miss)));
        assert_eq!(of("a.hlsl"), Some(Language::Hlsl));
        assert_eq!(of("common.glsl"), None);
        assert_eq!(of("a.rchit.spv"), None);
    }

    #[test]
    fn what_is_said_goes_before_the_extension() {
        use LanguageName as Name;
        let miss = Some(SourceStage::Miss);
        let said = |name, stage, path: &str| Language::said(name, stage, Path::new(path));
        for (name, stage, path, expected) in [
            (None, None, "a.glsl", None),
            (None, miss, "a.glsl", Some(Language::Glsl(SourceStage::Miss))),
            (None, miss, "a.rchit", Some(Language::Glsl(SourceStage::Miss))),
            (None, miss, "a.txt", None),
            (None, miss, "a.hlsl", Some(Language::Hlsl)),
            (Some(Name::Hlsl), None, "a.rchit", Some(Language::Hlsl)),
            (Some(Name::Slang), miss, "a.txt", Some(Language::Slang)),
            (Some(Name::Glsl), None, "a.rchit.glsl", Some(Language::Glsl(SourceStage::ClosestHit))),
            (Some(Name::Glsl), miss, "a.slang", Some(Language::Glsl(SourceStage::Miss))),
            (Some(Name::Wgsl), None, "a.txt", Some(Language::Wgsl)),
        ] {
            assert_eq!(said(name, stage, path), Ok(expected), "{name:?} {stage:?} {path}");
        }
        assert!(said(Some(Name::Glsl), None, "a.glsl").unwrap_err().contains("say the `stage`"));
        assert!(said(None, miss, "a.wgsl").unwrap_err().contains("itself"));
    }

    #[test]
    fn a_file_of_no_language_tells_how_to_say_it() {
        assert!(unknown_language("common.glsl").render().contains("which stage a plain .glsl file is of"));
        assert!(unknown_language("a.txt").render().contains("`--language`"));
    }
}
