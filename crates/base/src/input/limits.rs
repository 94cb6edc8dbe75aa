//! Limits of what is read and of what it may ask for: each with a name, a default and a sentence
//! that says how to raise it.
//!
//! A few words of SPIR-V, or a few bytes of a mesh, can ask for more than any machine has.

use std::str::FromStr;

use crate::error::{Error, ErrorKind, Result};

/// Writes the enum of limits, their names and their defaults from one row each.
macro_rules! limits {
    ($($(#[$doc:meta])* $variant:ident $name:literal $default:expr, $unit:literal;)*) => {
        /// One limit of [`InputLimits`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum InputLimit {
            $($(#[$doc])* $variant,)*
        }

        impl InputLimit {
            /// Every limit.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The name as `--limit NAME=N` takes it.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }

            /// The value where nobody sets another.
            pub fn default_value(self) -> u64 {
                match self {
                    $(Self::$variant => $default,)*
                }
            }

            /// What the limit counts, in words that follow a number.
            pub fn unit(self) -> &'static str {
                match self {
                    $(Self::$variant => $unit,)*
                }
            }
        }
    };
}

impl InputLimit {
    /// The greatest value that it can be set to: what counts words or registers fits 32 bits.
    #[must_use]
    pub fn ceiling(self) -> u64 {
        match self {
            Self::TypeNesting => 255,
            Self::Registers => 1 << 28,
            Self::WorkgroupBytes => 1 << 30,
            Self::ModuleBytes => 1 << 32,
            Self::SmokeResourceBytes | Self::SmokeLaunchBytes => 1 << 40,
            Self::ModuleIds
            | Self::ModuleInstructions
            | Self::ModuleConstants
            | Self::TypeParts
            | Self::Operations => u32::MAX.into(),
            _ => u64::MAX,
        }
    }
}

limits! {
    /// Bytes of a SPIR-V module: 2^25, seventeen times those of the largest known.
    ModuleBytes "module-bytes" 1 << 25, "bytes of a module";
    /// Result ids that a module defines: 4,194,303, the universal limit (SPIR-V, 2.17).
    ModuleIds "module-ids" 4_194_303, "ids that a module defines";
    /// Instructions of a module, those of names and debug information included: 2^22.
    ModuleInstructions "module-instructions" 1 << 22, "instructions of a module";
    /// Constants, specialization constants and undefined values at module scope: 2^21.
    ModuleConstants "module-constants" 1 << 21, "constants of a module";
    /// How deep types may be nested in types: 255, the universal limit of structures (SPIR-V,
    /// 2.17). It cannot be raised, as types are walked recursively.
    TypeNesting "type-nesting" 255, "types nested in types";
    /// Members, components and elements of one type, those of the types in it included; an array
    /// counts its element once, whatever its length: 2^20.
    TypeParts "type-parts" 1 << 20, "parts of a type, an array's element counted once";
    /// Registers, of 32 bits, of all variables and values of one entry point: 2^20.
    Registers "registers" 1 << 20, "registers of 32 bits for the variables and values of an entry point";
    /// Operations that one entry point is lowered to, and registers that its values name: 2^24.
    Operations "operations" 1 << 24, "operations, and registers of values, that an entry point is lowered to";
    /// Bytes of the memory that a workgroup shares: 2^24.
    WorkgroupBytes "workgroup-bytes" 1 << 24, "bytes of workgroup memory";
    /// Registers, of 32 bits, of all invocations of a workgroup: 2^26.
    WorkgroupRegisters "workgroup-registers" 1 << 26, "registers of a workgroup's invocations";
    /// Bytes of one resource that a smoke test makes up: 2^27.
    SmokeResourceBytes "smoke-resource-bytes" 1 << 27, "bytes of one synthetic resource of a smoke test";
    /// Bytes of all that a smoke test makes up for one launch: 2^29.
    SmokeLaunchBytes "smoke-launch-bytes" 1 << 29, "bytes of all synthetic inputs of a smoke test's launch";
    /// Bytes of a shader's source, and of each file that it includes: 2^26.
    SourceBytes "source-bytes" 1 << 26, "bytes of a source";
    /// Bytes of a scene's or test's own text, and of each file that it includes: 2^24. What is read
    /// from TOML takes some eighty times as much memory.
    SceneBytes "scene-bytes" 1 << 24, "bytes of TOML";
    /// Files of one scene, itself and those that it includes: 64.
    SceneFiles "scene-files" 64, "files of one scene";
    /// Bytes of a recording, and of each mesh, picture and buffer that a scene names: 2^31. Modules
    /// and sources have limits of their own.
    FileBytes "file-bytes" 1 << 31, "bytes of a file";
    /// Bytes of one buffer that a scene describes: 2^30.
    BufferBytes "buffer-bytes" 1 << 30, "bytes of a buffer";
    /// Bytes of all that one scene reads and makes, files, buffers, texels, primitives and
    /// descriptors together: 2^33.
    SceneMemory "scene-memory" 1 << 33, "bytes of one scene";
    /// Primitives in all acceleration structures of a scene: 2^26. A geometry that several lists
    /// name counts once for each list.
    ScenePrimitives "scene-primitives" 1 << 26, "primitives of one scene";
    /// Vertices that one mesh file gives, its shared meshes counted each time: 2^25.
    MeshVertices "mesh-vertices" 1 << 25, "vertices of a mesh";
    /// Triangles that one mesh file gives, its shared meshes counted each time: 2^25.
    MeshTriangles "mesh-triangles" 1 << 25, "triangles of a mesh";
    /// Nodes of a glTF scene that are visited, shared ones counted each time: 2^20.
    MeshNodes "mesh-nodes" 1 << 20, "nodes of a mesh";
    /// Elements of glTF accessors without a buffer view, which are zeros: 2^22.
    MeshSparse "mesh-sparse" 1 << 22, "elements of accessors without a buffer view";
    /// Objects and groups of an OBJ file, or values of a glTF file's JSON: 2^22.
    MeshValues "mesh-values" 1 << 22, "values of a mesh file";
    /// Width and height of an image, in texels: 32768, as the common `maxImageDimension2D`.
    ImageSide "image-side" 32_768, "texels along a side of an image";
    /// Bytes of one image's texels; for a picture file, with what its decoder holds beside them:
    /// 2^30.
    ImageBytes "image-bytes" 1 << 30, "bytes of an image";
    /// Mistakes of one file or scene that are shown; the others are counted: 50.
    ErrorsShown "errors-shown" 50, "errors that are shown";
}

/// The values of all limits: how much files, scenes and modules may hold, and what lowering a
/// module and smoke tests may take.
///
/// ```
/// use anyhit::{InputLimit, InputLimits};
///
/// let limits = InputLimits::default().with(InputLimit::MeshVertices, 1 << 27);
/// assert_eq!(limits.get(InputLimit::MeshVertices), 1 << 27);
/// assert_eq!(limits.get(InputLimit::SceneFiles), 64);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub struct InputLimits([u64; InputLimit::ALL.len()]);

impl Default for InputLimits {
    fn default() -> Self {
        let mut values = [0; InputLimit::ALL.len()];
        for limit in InputLimit::ALL {
            values[*limit as usize] = limit.default_value();
        }
        Self(values)
    }
}

impl InputLimits {
    /// The value of a limit.
    #[must_use]
    pub fn get(&self, limit: InputLimit) -> u64 {
        self.0[limit as usize]
    }

    /// These limits with another value of one, at most its [ceiling](InputLimit::ceiling).
    #[must_use]
    pub fn with(mut self, limit: InputLimit, value: u64) -> Self {
        self.0[limit as usize] = value.min(limit.ceiling());
        self
    }

    /// Compares a count with a limit: what is equal to it is allowed.
    ///
    /// # Errors
    /// Of this kind where the count is larger: it names the limit and how to raise it.
    #[doc(hidden)]
    #[inline]
    pub fn check(&self, limit: InputLimit, found: u64, kind: ErrorKind) -> Result<()> {
        if found <= self.get(limit) { Ok(()) } else { Err(self.exceeded(limit, Some(found), kind)) }
    }

    /// The error that a limit is exceeded, with the count where it is known.
    #[doc(hidden)]
    #[cold]
    pub fn exceeded(&self, limit: InputLimit, found: Option<u64>, kind: ErrorKind) -> Error {
        let (name, most, unit) = (limit.name(), self.get(limit), limit.unit());
        let message = match found {
            Some(found) => format!("{found} {unit} exceed the limit `{name}` of {most}"),
            None => format!("more {unit} than the limit `{name}` of {most} allows"),
        };
        let error = Error::new(kind, message).of_limit();
        if most >= limit.ceiling() {
            return error.note(format!("the limit `{name}` cannot be raised further"));
        }
        error.note(format!("help: raise it with `--limit {name}=N`, or in Rust with `InputLimits::with`"))
    }
}

/// A limit with its value: `mesh-vertices=67108864`, or with `KiB`, `MiB` or `GiB` behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitSetting {
    /// The limit.
    pub limit: InputLimit,
    /// Its value.
    pub value: u64,
}

impl FromStr for LimitSetting {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = |message: String| {
            let names: Vec<_> = InputLimit::ALL.iter().map(|limit| limit.name()).collect();
            Error::new(ErrorKind::InvalidArgument, message)
                .note(format!("the limits are: {}", names.join(", ")))
        };
        let Some((name, value)) = text.split_once('=') else {
            return Err(wrong(format!("`{text}` is not NAME=N")));
        };
        let Some(limit) = InputLimit::ALL.iter().find(|limit| limit.name() == name.trim()) else {
            return Err(wrong(format!("unknown limit `{name}`")));
        };
        let value = value.trim();
        let units = [("KiB", 10), ("MiB", 20), ("GiB", 30)];
        let (digits, shift) = units
            .iter()
            .find_map(|(unit, shift)| Some((value.strip_suffix(unit)?.trim_end(), *shift)))
            .unwrap_or((value, 0));
        let number = digits.parse::<u64>().ok().and_then(|number| number.checked_mul(1 << shift));
        match number {
            Some(value) => Ok(Self { limit: *limit, value }),
            None => Err(wrong(format!("`{value}` is not an integer from 0 to 2^64 - 1"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_apart_and_defaults_stand() {
        let names: std::collections::BTreeSet<_> = InputLimit::ALL.iter().map(|limit| limit.name()).collect();
        assert_eq!(names.len(), InputLimit::ALL.len());
        for limit in InputLimit::ALL {
            assert!(limit.default_value() <= limit.ceiling(), "{limit:?}");
            assert_eq!(InputLimits::default().get(*limit), limit.default_value());
            let changed = InputLimits::default().with(*limit, 7);
            let others = InputLimit::ALL.iter().filter(|other| *other != limit);
            assert_eq!(changed.get(*limit), 7);
            assert!(others.clone().all(|other| changed.get(*other) == other.default_value()));
        }
    }

    #[test]
    fn an_error_names_the_limit_and_how_to_raise_it() {
        let limits = InputLimits::default();
        assert!(limits.check(InputLimit::SceneFiles, 64, ErrorKind::InvalidScene).is_ok());
        let error = limits.check(InputLimit::SceneFiles, 65, ErrorKind::InvalidScene).unwrap_err();
        assert_eq!(error.message(), "65 files of one scene exceed the limit `scene-files` of 64");
        let help = "help: raise it with `--limit scene-files=N`, or in Rust with `InputLimits::with`";
        assert_eq!(error.notes(), [help]);
    }

    /// The largest of 2,538 modules of real projects and of conformance tests has 1,878,356 bytes,
    /// 122,663 ids and, in another form of it, 164,798 instructions, of which no module has fewer
    /// than constants.
    #[test]
    fn defaults_are_eight_times_what_real_modules_need() {
        let largest = [
            (InputLimit::ModuleBytes, 1_878_356),
            (InputLimit::ModuleIds, 122_663),
            (InputLimit::ModuleInstructions, 164_798),
            (InputLimit::ModuleConstants, 164_798),
        ];
        for (limit, largest) in largest {
            assert!(limit.default_value() >= 8 * largest, "{limit:?}");
        }
    }

    #[test]
    fn no_limit_is_set_above_its_ceiling() {
        let limits = InputLimits::default().with(InputLimit::TypeNesting, 1000);
        assert_eq!(limits.get(InputLimit::TypeNesting), 255);
        let error = limits.check(InputLimit::TypeNesting, 256, ErrorKind::UnsupportedModule).unwrap_err();
        assert_eq!(error.notes(), ["the limit `type-nesting` cannot be raised further"]);
    }

    #[test]
    fn settings_are_read_or_refused() {
        let read = |text: &str| text.parse::<LimitSetting>();
        let setting = LimitSetting { limit: InputLimit::FileBytes, value: 4 << 30 };
        assert_eq!(read("file-bytes=4GiB").unwrap(), setting);
        assert_eq!(read("file-bytes = 4294967296").unwrap(), setting);
        assert_eq!(read("errors-shown=3").unwrap().value, 3);
        for wrong in ["", "file-bytes", "file_bites=1", "file-bytes=-1", "file-bytes=99999999999GiB"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
        let error = read("file_bites=1").unwrap_err();
        assert!(error.notes()[0].contains("file-bytes, buffer-bytes"), "{error}");
    }
}
