//! Access chains: instructions that lead from a pointer to a part of what it points to.
//!
//! There are typed ones and untyped ones (`SPV_KHR_untyped_pointers`), each with and without a
//! step to another element of an array first.

use crate::module::ty::TypeId;
use crate::module::{Id, Instruction, Module, Opcode};

/// The operands of an access chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AccessChain<'m> {
    /// The pointer that it begins with.
    pub base: Id,
    /// Of an untyped chain: the id of the type whose parts the indices select.
    pub base_type: Option<Id>,
    /// The index of the element to step to first (`OpPtrAccessChain`).
    pub element: Option<Id>,
    /// The ids of the indices.
    pub indices: &'m [u32],
}

impl<'m> AccessChain<'m> {
    /// The chain of an instruction with these operands behind its result; `None` for any other
    /// instruction.
    pub fn of(opcode: Opcode, operands: &'m [u32]) -> Option<Self> {
        let (is_untyped, has_element) = match opcode {
            Opcode::AccessChain | Opcode::InBoundsAccessChain => (false, false),
            Opcode::PtrAccessChain | Opcode::InBoundsPtrAccessChain => (false, true),
            Opcode::UntypedAccessChainKHR | Opcode::UntypedInBoundsAccessChainKHR => (true, false),
            Opcode::UntypedPtrAccessChainKHR | Opcode::UntypedInBoundsPtrAccessChainKHR => (true, true),
            _ => return None,
        };
        let (base_type, operands) = match is_untyped {
            true => operands.split_first().map(|(&ty, rest)| (Some(Id(ty)), rest))?,
            false => (None, operands),
        };
        let (&base, operands) = operands.split_first()?;
        let (element, indices) = match has_element {
            true => operands.split_first().map(|(&element, rest)| (Some(Id(element)), rest))?,
            false => (None, operands),
        };
        Some(Self { base: Id(base), base_type, element, indices })
    }
}

impl Opcode {
    /// Returns true for access chains that stay within what their base points to: those without a
    /// step to another element.
    pub fn selects_part(self) -> bool {
        matches!(
            self,
            Self::AccessChain
                | Self::InBoundsAccessChain
                | Self::UntypedAccessChainKHR
                | Self::UntypedInBoundsAccessChainKHR
        )
    }
}

impl Module {
    /// The access chain that an instruction is; `None` for any other instruction.
    #[doc(hidden)]
    pub fn access_chain(&self, instruction: &Instruction) -> Option<AccessChain<'_>> {
        AccessChain::of(instruction.opcode, self.operands(instruction))
    }

    /// The type whose parts the indices of a chain select.
    #[doc(hidden)]
    pub fn chain_type(&self, chain: AccessChain<'_>) -> Option<TypeId> {
        match chain.base_type {
            Some(id) => self.type_with_id(id),
            None => self.pointee(chain.base),
        }
    }

    /// The type that the indices of an untyped chain lead to, where an id is the result of one.
    pub(super) fn untyped_pointee(&self, pointer: Id) -> Option<TypeId> {
        let chain = self.access_chain(self.result_instruction(pointer)?)?;
        let mut ty = self.type_with_id(chain.base_type?)?;
        for &index in chain.indices {
            ty = self.part(ty, self.scalar_value(Id(index)))?;
        }
        Some(ty)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operands_of_every_chain() {
        let chain = |opcode, operands| AccessChain::of(opcode, operands);
        let (base, element) = (Id(2), Some(Id(3)));
        assert_eq!(
            chain(Opcode::InBoundsAccessChain, &[2, 3, 4]),
            Some(AccessChain { base, base_type: None, element: None, indices: &[3, 4] })
        );
        assert_eq!(
            chain(Opcode::PtrAccessChain, &[2, 3, 4]),
            Some(AccessChain { base, base_type: None, element, indices: &[4] })
        );
        assert_eq!(
            chain(Opcode::UntypedAccessChainKHR, &[1, 2, 3]),
            Some(AccessChain { base, base_type: Some(Id(1)), element: None, indices: &[3] })
        );
        assert_eq!(
            chain(Opcode::UntypedInBoundsPtrAccessChainKHR, &[1, 2, 3]),
            Some(AccessChain { base, base_type: Some(Id(1)), element, indices: &[] })
        );
        assert_eq!(chain(Opcode::UntypedPtrAccessChainKHR, &[1, 2]), None);
        assert_eq!(chain(Opcode::Load, &[2]), None);
    }
}
