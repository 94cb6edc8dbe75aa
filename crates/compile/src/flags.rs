//! Flags for the compiler of one source, as a scene's `compiler_flags` gives them.
//!
//! Only flags of a list are taken: none that writes a file, names another target or runs another
//! program. `slangc` is given them as they are; for the others they become options.

use super::{CompileOptions, DebugInfoLevel, Language, Optimize};
use anyhit_base::error::{Error, ErrorKind, Result};

/// Flags that `slangc` is given as they are, which take no value.
const SLANG_FLAGS: [&str; 36] = [
    "-force-glsl-scalar-layout",
    "-fvk-use-scalar-layout",
    "-fvk-use-c-layout",
    "-fvk-use-dx-layout",
    "-fvk-use-gl-layout",
    "-fvk-use-dx-position-w",
    "-fvk-invert-y",
    "-fspv-reflect",
    "-matrix-layout-row-major",
    "-matrix-layout-column-major",
    "-emit-spirv-directly",
    "-emit-spirv-via-glsl",
    "-preserve-params",
    "-parameter-blocks-use-register-spaces",
    "-spirv-unified-descriptor-heap-stride",
    "-ignore-capabilities",
    "-restrictive-capability-check",
    "-default-image-format-unknown",
    "-zero-initialize",
    "-unscoped-enum",
    "-msvc-style-bitfield-packing",
    "-disable-short-circuit",
    "-disable-dynamic-dispatch",
    "-disable-specialization",
    "-disable-non-essential-validations",
    "-minimum-slang-optimization",
    "-incomplete-library",
    "-allow-glsl",
    "-enable-effect-annotations",
    "-enable-experimental-passes",
    "-enable-experimental-dynamic-dispatch",
    "-experimental-feature",
    "-validate-uniformity",
    "-no-mangle",
    "-debug-info-include-source",
    "-report-dynamic-dispatch-sites",
];

/// Flags that `slangc` is given as they are, with the values that follow.
const SLANG_VALUES: [(&str, &[FlagValue]); 21] = [
    ("-fvk-b-shift", &[FlagValue::Number, FlagValue::Space]),
    ("-fvk-t-shift", &[FlagValue::Number, FlagValue::Space]),
    ("-fvk-s-shift", &[FlagValue::Number, FlagValue::Space]),
    ("-fvk-u-shift", &[FlagValue::Number, FlagValue::Space]),
    ("-fvk-bind-globals", &[FlagValue::Number, FlagValue::Number]),
    ("-bindless-space-index", &[FlagValue::Number]),
    ("-spirv-resource-heap-stride", &[FlagValue::Number]),
    ("-spirv-sampler-heap-stride", &[FlagValue::Number]),
    ("-conformance", &[FlagValue::Conformance]),
    ("-specialize", &[FlagValue::Text]),
    ("-capability", &[FlagValue::Text]),
    ("-profile", &[FlagValue::Text]),
    ("-std", &[FlagValue::Text]),
    ("-fp-mode", &[FlagValue::Text]),
    ("-floating-point-mode", &[FlagValue::Text]),
    ("-denorm-mode-fp16", &[FlagValue::Text]),
    ("-denorm-mode-fp32", &[FlagValue::Text]),
    ("-denorm-mode-fp64", &[FlagValue::Text]),
    ("-line-directive-mode", &[FlagValue::Text]),
    ("-warnings-disable", &[FlagValue::Text]),
    ("-warnings-as-errors", &[FlagValue::Text]),
];

/// Begins flags of warnings: `-Wall`, `-W41017`, `-Wno-uninitialized`.
const SLANG_WARNING: &str = "-W";

/// What follows a flag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FlagValue {
    /// Anything that does not look like a flag.
    Text,
    /// A number.
    Number,
    /// The number of a register space or descriptor set, or `all`.
    Space,
    /// A type, an interface, and the number that stands for the type.
    Conformance,
}

impl FlagValue {
    /// What a list of flags calls it.
    fn name(self) -> &'static str {
        match self {
            Self::Text => "VALUE",
            Self::Number => "N",
            Self::Space => "SPACE",
            Self::Conformance => "TYPE:INTERFACE[=N]",
        }
    }

    fn takes(self, value: &str) -> bool {
        let is_number = || value.parse::<u32>().is_ok();
        match self {
            Self::Text => true,
            Self::Number => is_number(),
            Self::Space => value == "all" || is_number(),
            Self::Conformance => value.contains(':'),
        }
    }
}

/// Compiler flags that were checked for the language of a source.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct CompilerFlags {
    /// Names that `-D NAME[=VALUE]` defines.
    pub(super) defines: Vec<(String, Option<String>)>,
    /// Flags with their values that an outside compiler is given as they are.
    pub(super) passed: Vec<String>,
    folders: Vec<String>,
    debug: Option<DebugInfoLevel>,
    optimize: Option<Optimize>,
}

/// A flag that a compiler does not take: its number in the list, and why.
#[derive(Debug)]
pub struct RefusedFlag {
    /// Index of the flag, or of its value.
    pub at: usize,
    /// What is wrong with it.
    pub message: String,
    /// Which flags there are.
    pub note: String,
}

impl CompilerFlags {
    /// Checks a list of flags for a language. Values stand behind their flags, or in the next
    /// element of the list: `-DX=1` and `-D`, `X=1` are the same.
    ///
    /// ```
    /// use anyhit::{CompilerFlags, Language};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// CompilerFlags::of(Language::Slang, &["-force-glsl-scalar-layout", "-DSPHERES=3"])?;
    /// let refused = CompilerFlags::of(Language::Slang, &["-o", "a.spv"]).unwrap_err();
    /// assert_eq!(refused.message(), "the flag `-o` is not passed on to slangc");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`ErrorKind::InvalidArgument`] for the first flag that is not on the language's list, or
    /// whose value is missing or looks like a flag.
    pub fn of<S: AsRef<str>>(language: Language, flags: &[S]) -> Result<Self> {
        let refused =
            |flag: RefusedFlag| Error::new(ErrorKind::InvalidArgument, flag.message).note(flag.note);
        Self::parse(language, flags).map_err(refused)
    }

    /// Checks flags as [`CompilerFlags::of`] does, and tells which one is refused.
    ///
    /// # Errors
    /// The first flag that is refused.
    #[doc(hidden)]
    pub fn parse<S: AsRef<str>>(language: Language, flags: &[S]) -> std::result::Result<Self, RefusedFlag> {
        let is_slang = matches!(language, Language::Slang | Language::Hlsl);
        let refused = |at, message| RefusedFlag { at, message, note: known(language) };
        let mut all = Self::default();
        let mut at = 0;
        while let Some(flag) = flags.get(at).map(AsRef::as_ref) {
            let begin = at;
            at += 1;
            if flag.chars().any(char::is_control) {
                return Err(refused(begin, "a flag must not contain control characters".to_owned()));
            }
            let mut value = |attached: &str| {
                let mut value = attached.to_owned();
                if value.is_empty() {
                    let next = flags.get(at).map(|next| next.as_ref().to_owned());
                    value =
                        next.ok_or_else(|| refused(begin, format!("the flag `{flag}` requires a value")))?;
                    at += 1;
                }
                if value.is_empty() || value.starts_with('-') {
                    let message = format!("`{value}` is not a value of the flag `{flag}`");
                    return Err(refused(at - 1, message));
                }
                Ok(value)
            };
            match flag {
                "-g0" => all.debug = Some(DebugInfoLevel::Names),
                "-g" | "-g1" => all.debug = Some(DebugInfoLevel::Lines),
                "-g2" | "-g3" | "-gVS" => all.debug = Some(DebugInfoLevel::Full),
                "-O0" => all.optimize = Some(Optimize::Off),
                "-O1" if is_slang => all.optimize = Some(Optimize::Default),
                "-O2" | "-O3" if is_slang => all.optimize = Some(Optimize::High),
                _ if language == Language::Wgsl => {
                    return Err(refused(begin, format!("naga has no flag `{flag}`")));
                }
                _ if is_slang && SLANG_FLAGS.contains(&flag) => all.passed.push(flag.to_owned()),
                _ if is_slang && is_warning_flag(flag) => all.passed.push(flag.to_owned()),
                _ if is_slang && slang_values(flag).is_some() => {
                    all.passed.push(flag.to_owned());
                    for &kind in slang_values(flag).unwrap_or_default() {
                        let value = value("")?;
                        if !kind.takes(&value) {
                            let message =
                                format!("the flag `{flag}` requires {}, not `{value}`", kind.name());
                            return Err(refused(at - 1, message));
                        }
                        all.passed.push(value);
                    }
                }
                _ => match (flag.strip_prefix("-D"), flag.strip_prefix("-I")) {
                    (Some(attached), _) => {
                        let value = value(attached)?;
                        let (name, value) = match value.split_once('=') {
                            Some((name, value)) => (name, Some(value.to_owned())),
                            None => (value.as_str(), None),
                        };
                        if !is_identifier(name) {
                            return Err(refused(at - 1, format!("`-D` cannot define `{name}`")));
                        }
                        all.defines.push((name.to_owned(), value));
                    }
                    (_, Some(attached)) => all.folders.push(value(attached)?),
                    _ => {
                        let compiler = if is_slang { "slangc" } else { "glslang" };
                        return Err(refused(
                            begin,
                            format!("the flag `{flag}` is not passed on to {compiler}"),
                        ));
                    }
                },
            }
        }
        Ok(all)
    }

    /// The include folders of `-I`, as they are written.
    #[doc(hidden)]
    pub fn include_folders(&self) -> &[String] {
        &self.folders
    }

    /// These options, with what the flags say instead.
    #[doc(hidden)]
    #[must_use]
    pub fn over(&self, options: &CompileOptions) -> CompileOptions {
        CompileOptions {
            debug: self.debug.unwrap_or(options.debug),
            optimize: self.optimize.unwrap_or(options.optimize),
            flags: self.clone(),
            entry_point: options.entry_point.clone(),
        }
    }
}

/// What follows a flag that `slangc` is given with values.
fn slang_values(flag: &str) -> Option<&'static [FlagValue]> {
    SLANG_VALUES.iter().find(|(name, _)| *name == flag).map(|(_, values)| *values)
}

/// Whether a flag says which warnings there are, by the name or number of one or of a group.
fn is_warning_flag(flag: &str) -> bool {
    let is_part = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
    flag.strip_prefix(SLANG_WARNING).is_some_and(|name| !name.is_empty() && name.chars().all(is_part))
}

fn is_identifier(name: &str) -> bool {
    let mut letters = name.chars();
    letters.next().is_some_and(|first| first.is_ascii_alphabetic() || first == '_')
        && letters.all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
}

/// The flags that the compiler of a language takes.
fn known(language: Language) -> String {
    match language {
        Language::Wgsl => "the flags of a WGSL source are: -g0, -g, -gVS, -O0".to_owned(),
        Language::Glsl(_) => {
            "the flags of a GLSL source are: -D NAME[=VALUE], -I FOLDER, -g0, -g, -gVS, -O0".to_owned()
        }
        Language::Slang | Language::Hlsl => {
            let name = if language == Language::Slang { "a Slang" } else { "an HLSL" };
            let with_values = |(flag, values): &(&str, &[FlagValue])| {
                let values: String = values.iter().map(|value| format!(" {}", value.name())).collect();
                format!(", {flag}{values}")
            };
            let values: String = SLANG_VALUES.iter().map(with_values).collect();
            let list = SLANG_FLAGS.join(", ");
            format!(
                "the flags of {name} source are: -D NAME[=VALUE], -I FOLDER, -g0, -g, -g2, -O0 to -O3{values}, \
                 -WNAME, -Wno-NAME, {list}"
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_base::error::Stage;

    const GLSL: Language = Language::Glsl(Stage::Compute);

    #[test]
    fn flags_become_definitions_folders_options_and_arguments() {
        let list =
            ["-DA", "-D", "B=x=1", "-Icommon", "-I", "../more", "-O0", "-g2", "-fvk-use-scalar-layout"];
        let flags =
            CompilerFlags::parse(Language::Slang, &[&list[..], &["-capability", "spvRayQueryKHR"]].concat());
        let flags = flags.unwrap();
        assert_eq!(flags.define_arguments().collect::<Vec<_>>(), ["-DA", "-DB=x=1"]);
        assert_eq!(flags.include_folders(), ["common", "../more"]);
        assert_eq!(flags.passed, ["-fvk-use-scalar-layout", "-capability", "spvRayQueryKHR"]);
        let options = flags.over(&CompileOptions::default());
        assert_eq!((options.debug, options.optimize), (DebugInfoLevel::Full, Optimize::Off));
        // What no flag says stays.
        let lines = CompileOptions { debug: DebugInfoLevel::Lines, ..CompileOptions::default() };
        let none = CompilerFlags::parse::<&str>(GLSL, &[]).unwrap();
        assert_eq!(none.over(&lines), lines);
    }

    #[test]
    fn flags_that_decide_bindings_are_given_as_they_are_with_both_values() {
        let list = [
            "-fvk-b-shift",
            "0",
            "all",
            "-fvk-t-shift",
            "10",
            "0",
            "-fvk-bind-globals",
            "3",
            "1",
            "-conformance",
            "Material:IMaterial=0",
            "-Wno-39029",
            "-Wall",
            "-fvk-invert-y",
        ];
        for language in [Language::Slang, Language::Hlsl] {
            assert_eq!(CompilerFlags::parse(language, &list).unwrap().passed, list);
        }
        assert_eq!(CompilerFlags::parse(GLSL, &list).unwrap_err().at, 0);
    }

    #[test]
    fn what_a_compiler_does_not_take_is_refused_with_its_list() {
        for (language, flags, at, message, note) in [
            (
                Language::Slang,
                &["-O0", "-o", "a"][..],
                1,
                "the flag `-o` is not passed on to slangc",
                "of a Slang",
            ),
            (
                Language::Hlsl,
                &["-target", "dxil"],
                0,
                "the flag `-target` is not passed on to slangc",
                "of an HLSL",
            ),
            (
                Language::Slang,
                &["-dump-intermediates"],
                0,
                "`-dump-intermediates` is not passed on",
                "-O0 to -O3",
            ),
            (
                Language::Slang,
                &["-depfile=x"],
                0,
                "the flag `-depfile=x` is not passed on to slangc",
                "-std VALUE",
            ),
            (Language::Slang, &["-D", "-o"], 1, "`-o` is not a value of the flag `-D`", ""),
            (Language::Slang, &["-I-o"], 0, "`-o` is not a value of the flag `-I-o`", ""),
            (Language::Slang, &["-capability", "-o"], 1, "`-o` is not a value of the flag `-capability`", ""),
            (Language::Slang, &["-capability"], 0, "the flag `-capability` requires a value", ""),
            (Language::Slang, &["-fvk-t-shift", "10"], 0, "the flag `-fvk-t-shift` requires a value", ""),
            (
                Language::Hlsl,
                &["-fvk-t-shift", "ten", "0"],
                1,
                "the flag `-fvk-t-shift` requires N, not `ten`",
                "-fvk-t-shift N SPACE, ",
            ),
            (Language::Hlsl, &["-fvk-u-shift", "1", "any"], 2, "requires SPACE, not `any`", ""),
            (Language::Hlsl, &["-fvk-bind-globals", "1", "all"], 2, "requires N, not `all`", ""),
            (
                Language::Slang,
                &["-conformance", "Material"],
                1,
                "the flag `-conformance` requires TYPE:INTERFACE[=N], not `Material`",
                "",
            ),
            (Language::Slang, &["-W"], 0, "the flag `-W` is not passed on to slangc", ""),
            (Language::Slang, &["-Wa/b"], 0, "the flag `-Wa/b` is not passed on to slangc", "-Wno-NAME"),
            (Language::Slang, &["-D1=2"], 0, "`-D` cannot define `1`", ""),
            (Language::Slang, &["file.slang"], 0, "the flag `file.slang` is not passed on to slangc", ""),
            (
                GLSL,
                &["-O2"],
                0,
                "the flag `-O2` is not passed on to glslang",
                "the flags of a GLSL source are: -D",
            ),
            (
                GLSL,
                &["-force-glsl-scalar-layout"],
                0,
                "the flag `-force-glsl-scalar-layout` is not passed on to glslang",
                "-I FOLDER, -g0",
            ),
            (
                Language::Wgsl,
                &["-DX"],
                0,
                "naga has no flag `-DX`",
                "the flags of a WGSL source are: -g0, -g, -gVS",
            ),
        ] {
            let refused = CompilerFlags::parse(language, flags).unwrap_err();
            assert_eq!(refused.at, at, "{flags:?}");
            assert!(refused.message.contains(message), "{flags:?}: {}", refused.message);
            assert!(refused.note.contains(note), "{flags:?}: {}", refused.note);
        }
    }
}
