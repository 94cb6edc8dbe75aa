//! Where a subnormal number makes a difference, as an implementation may flush it to 0.

use anyhit_engine::module::Opcode;

/// Where a subnormal number makes a difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlushedUse {
    /// It is a divisor.
    Divisor,
    /// It is compared for `<` or `>=`.
    Below,
    /// It is compared for `>` or `<=`.
    Above,
    /// It is compared for `==` or `!=`.
    Equal,
}

impl FlushedUse {
    /// What the number does, for a report.
    pub fn does(self) -> &'static str {
        match self {
            Self::Divisor => "is the divisor",
            _ => "decides a comparison",
        }
    }
}

/// The kind of comparison that an instruction is; `None` for others.
pub(super) fn comparison(opcode: Opcode) -> Option<FlushedUse> {
    use Opcode as O;
    Some(match opcode {
        O::FOrdLessThan | O::FUnordLessThan | O::FOrdGreaterThanEqual | O::FUnordGreaterThanEqual => {
            FlushedUse::Below
        }
        O::FOrdGreaterThan | O::FUnordGreaterThan | O::FOrdLessThanEqual | O::FUnordLessThanEqual => {
            FlushedUse::Above
        }
        O::FOrdEqual | O::FUnordEqual | O::FOrdNotEqual | O::FUnordNotEqual => FlushedUse::Equal,
        _ => return None,
    })
}
