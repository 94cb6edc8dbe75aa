//! The argument `--limit`, which every command takes that loads modules.

use clap::Args;

use crate::module::{ModuleLimit, ModuleLimits};

/// The limits of the modules that a command loads.
#[derive(Args, Clone, Debug, Default)]
pub struct LimitArgs {
    /// Change a limit of modules, such as module-bytes=256MiB; docs/limits.md lists them all
    #[arg(long = "limit", value_name = "NAME=NUMBER", value_parser = parse)]
    limits: Vec<(ModuleLimit, u64)>,
}

impl LimitArgs {
    /// The defaults, with what the command line changes; the last of several values counts.
    pub fn module_limits(&self) -> ModuleLimits {
        self.limits.iter().fold(ModuleLimits::default(), |all, &(limit, value)| all.with(limit, value))
    }
}

/// Reads `NAME=NUMBER`; a number of bytes may have a unit behind it.
fn parse(text: &str) -> Result<(ModuleLimit, u64), String> {
    let (name, number) = text.split_once('=').ok_or("NAME=NUMBER is needed")?;
    let limit = ModuleLimit::named(name).ok_or_else(|| {
        let names: Vec<_> = ModuleLimit::ALL.iter().map(|limit| limit.name()).collect();
        format!("there is no limit `{name}`; there are {}", names.join(", "))
    })?;
    let units = [("KiB", 10), ("MiB", 20), ("GiB", 30)];
    let unit = units.iter().find_map(|(unit, shift)| Some((number.strip_suffix(unit)?, *shift)));
    let (digits, shift) = unit.filter(|_| limit.is_bytes()).unwrap_or((number, 0));
    let value = digits.trim().parse::<u64>().ok().and_then(|value| value.checked_mul(1 << shift));
    let value = value.ok_or_else(|| format!("`{number}` is no number"))?;
    match value <= limit.ceiling() {
        true => Ok((limit, value)),
        false => Err(format!("{name} is at most {}", limit.ceiling())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_have_units_and_the_rest_has_none() {
        assert_eq!(parse("module-bytes=3MiB"), Ok((ModuleLimit::ModuleBytes, 3 << 20)));
        assert_eq!(parse("ids=12"), Ok((ModuleLimit::Ids, 12)));
        for wrong in ["ids", "ids=", "ids=1KiB", "ids=-1", "module-bytes=99999999999999999999GiB"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
        assert!(parse("idz=1").unwrap_err().contains("there are module-bytes, ids, "));
        assert_eq!(parse("type-nesting=256").unwrap_err(), "type-nesting is at most 255");
        assert!(parse("resource-bytes=18446744073709551615GiB").is_err());
    }

    #[test]
    fn the_last_value_counts() {
        let limits = vec![(ModuleLimit::Ids, 1), (ModuleLimit::Ids, 2)];
        assert_eq!(LimitArgs { limits }.module_limits().get(ModuleLimit::Ids), 2);
    }
}
