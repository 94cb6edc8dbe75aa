//! Limits of what a module may ask for: how large it is, and how much memory and time it takes to
//! load, to lower and to make up inputs for.
//!
//! A few words of SPIR-V can ask for more than any machine has. Each limit has a name, under which
//! the command line sets it (`--limit NAME=NUMBER`), and a default far above what real modules
//! need; what goes beyond is an error that names the limit.

use crate::error::{Error, ErrorKind, Result};

/// A limit of modules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ModuleLimit {
    /// Bytes of a module.
    ModuleBytes,
    /// Result ids that a module defines.
    Ids,
    /// Instructions of a module, those of names and debug information included.
    Instructions,
    /// Constants, specialization constants and undefined values at module scope.
    Constants,
    /// How deep types may be nested in types.
    TypeNesting,
    /// Members, components and elements of one type, those of the types in it included; an array
    /// counts its element once, whatever its length.
    TypeParts,
    /// Registers, of 32 bits, of all variables and values of one entry point.
    Registers,
    /// Operations that one entry point is lowered to, and registers that its values name.
    Operations,
    /// Bytes of the memory that a workgroup shares.
    WorkgroupBytes,
    /// Bytes of one resource that a smoke test makes up.
    ResourceBytes,
    /// Bytes of all that a smoke test makes up for one launch.
    LaunchBytes,
}

impl ModuleLimit {
    /// All limits, in the order in which loading and running meet them.
    pub const ALL: [Self; 11] = [
        Self::ModuleBytes,
        Self::Ids,
        Self::Instructions,
        Self::Constants,
        Self::TypeNesting,
        Self::TypeParts,
        Self::Registers,
        Self::Operations,
        Self::WorkgroupBytes,
        Self::ResourceBytes,
        Self::LaunchBytes,
    ];

    /// The name on the command line: `type-nesting`.
    pub fn name(self) -> &'static str {
        match self {
            Self::ModuleBytes => "module-bytes",
            Self::Ids => "ids",
            Self::Instructions => "instructions",
            Self::Constants => "constants",
            Self::TypeNesting => "type-nesting",
            Self::TypeParts => "type-parts",
            Self::Registers => "registers",
            Self::Operations => "operations",
            Self::WorkgroupBytes => "workgroup-bytes",
            Self::ResourceBytes => "resource-bytes",
            Self::LaunchBytes => "launch-bytes",
        }
    }

    /// The limit of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|limit| limit.name() == name)
    }

    /// What is limited, in words that follow a number: `types nested in types`.
    pub fn what(self) -> &'static str {
        match self {
            Self::ModuleBytes => "bytes of a module",
            Self::Ids => "ids that a module defines",
            Self::Instructions => "instructions of a module",
            Self::Constants => "constants of a module",
            Self::TypeNesting => "types nested in types",
            Self::TypeParts => "parts of a type, an array's element counted once",
            Self::Registers => "registers of 32 bits for the variables and values of an entry point",
            Self::Operations => "operations, and registers of values, that an entry point is lowered to",
            Self::WorkgroupBytes => "bytes of workgroup memory",
            Self::ResourceBytes => "bytes of one resource that a smoke test makes up",
            Self::LaunchBytes => "bytes of all that a smoke test makes up for a launch",
        }
    }

    /// The default.
    ///
    /// Ids and the nesting of types are the specification's universal limits (SPIR-V, 2.17). Of
    /// 2,538 modules of real projects and of conformance tests, the largest has 1,878,356 bytes,
    /// 122,663 ids and, in another form of it, 164,798 instructions: each default is above eight
    /// times the largest.
    pub fn default_value(self) -> u64 {
        match self {
            Self::ModuleBytes => 32 << 20,
            Self::Ids => 4_194_303,
            Self::Instructions => 1 << 22,
            Self::Constants => 1 << 21,
            Self::TypeNesting => 255,
            Self::TypeParts => 1 << 20,
            Self::Registers => 1 << 20,
            Self::Operations => 1 << 24,
            Self::WorkgroupBytes => 16 << 20,
            Self::ResourceBytes => 128 << 20,
            Self::LaunchBytes => 512 << 20,
        }
    }

    /// The greatest value that it can be set to.
    ///
    /// What counts words or registers fits 32 bits. Types are walked recursively, so their nesting
    /// stays what the specification asks of everyone (2.17, "Structure nesting depth").
    pub fn ceiling(self) -> u64 {
        match self {
            Self::TypeNesting => 255,
            Self::Registers => 1 << 28,
            Self::ModuleBytes => 4 << 30,
            Self::WorkgroupBytes => 1 << 30,
            Self::ResourceBytes | Self::LaunchBytes => 1 << 40,
            _ => u64::from(u32::MAX),
        }
    }

    /// Whether it counts bytes.
    pub fn is_bytes(self) -> bool {
        matches!(self, Self::ModuleBytes | Self::WorkgroupBytes | Self::ResourceBytes | Self::LaunchBytes)
    }
}

/// The limits that a module is loaded with; it keeps them, and lowering and smoke tests heed them.
///
/// ```
/// use anyhit::module::{self, ModuleLimit, ModuleLimits};
///
/// let bytes = std::fs::read("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv").unwrap();
/// let small = ModuleLimits::default().with(ModuleLimit::ModuleBytes, 100);
/// let error = module::load_with(&bytes, small).unwrap_err();
/// assert!(error.message().ends_with("the limit is 100 bytes of a module"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModuleLimits([u64; ModuleLimit::ALL.len()]);

impl Default for ModuleLimits {
    fn default() -> Self {
        Self(ModuleLimit::ALL.map(ModuleLimit::default_value))
    }
}

impl ModuleLimits {
    /// The value of a limit: what is equal to it is allowed.
    pub fn get(&self, limit: ModuleLimit) -> u64 {
        self.0[limit as usize]
    }

    /// These limits with another value of one, at most its [ceiling](ModuleLimit::ceiling).
    #[must_use]
    pub fn with(mut self, limit: ModuleLimit, value: u64) -> Self {
        self.0[limit as usize] = value.min(limit.ceiling());
        self
    }

    /// Holds a number against a limit.
    ///
    /// # Errors
    /// `UnsupportedModule` where it is greater; the error names the limit and says how to raise it.
    #[inline]
    pub fn check(&self, limit: ModuleLimit, found: u64) -> Result<()> {
        if found <= self.get(limit) { Ok(()) } else { Err(self.exceeded(limit, Some(found))) }
    }

    /// The error of a number that is greater than a limit; `None` where it is not known.
    #[cold]
    pub fn exceeded(&self, limit: ModuleLimit, found: Option<u64>) -> Error {
        let (name, what, value) = (limit.name(), limit.what(), self.get(limit));
        let found = match found {
            Some(u64::MAX) | None => "more than is allowed".to_owned(),
            Some(found) => found.to_string(),
        };
        let message = format!("{found}, where the limit is {value} {what}");
        let error = Error::new(ErrorKind::UnsupportedModule, message);
        if value >= limit.ceiling() {
            return error.note(format!("`{name}` is as high as it can be set"));
        }
        error.note(format!(
            "raise it with `--limit {name}=NUMBER` (in Rust: `ModuleLimits::with`), up to {}",
            limit.ceiling()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_their_limits() {
        for (at, limit) in ModuleLimit::ALL.into_iter().enumerate() {
            assert_eq!(limit as usize, at, "{limit:?}");
            assert_eq!(ModuleLimit::named(limit.name()), Some(limit));
            assert!(limit.default_value() <= limit.ceiling(), "{limit:?}");
        }
        assert_eq!(ModuleLimit::named("type_nesting"), None);
    }

    #[test]
    fn what_is_equal_to_a_limit_is_allowed() {
        let limits = ModuleLimits::default().with(ModuleLimit::Ids, 3);
        assert!(limits.check(ModuleLimit::Ids, 3).is_ok());
        let error = limits.check(ModuleLimit::Ids, 4).unwrap_err();
        assert_eq!(error.message(), "4, where the limit is 3 ids that a module defines");
        assert_eq!(
            error.notes(),
            ["raise it with `--limit ids=NUMBER` (in Rust: `ModuleLimits::with`), up to 4294967295"]
        );
    }

    /// The figures of the largest modules are those that [`ModuleLimit::default_value`] tells of.
    #[test]
    fn defaults_are_eight_times_what_real_modules_need() {
        let largest = [
            (ModuleLimit::ModuleBytes, 1_878_356),
            (ModuleLimit::Ids, 122_663),
            (ModuleLimit::Instructions, 164_798),
            // No module has more constants than instructions.
            (ModuleLimit::Constants, 164_798),
        ];
        for (limit, largest) in largest {
            assert!(limit.default_value() >= 8 * largest, "{limit:?}");
        }
    }
}
