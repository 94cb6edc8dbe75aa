//! Describes the out-of-bounds index of an access that trapped: its value, the array and the
//! array's length.

use crate::machine::{AccessFault, LaneTrap, OpIndex, Reg, TrapCode};
use crate::module::access_chain::AccessChain;
use crate::module::hit_ids::{HitId, HitIds};
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Opcode};
use crate::ops::access::Access;
use crate::ops::atomic;
use crate::ops::memory::{ComputedOffset, Length};
use crate::ops::op::Op;
use crate::program::Program;
use anyhit_base::error::IndexOperand;

/// An index of an access chain, and the composite that it indexes.
struct ChainIndex {
    /// The source expression of the composite: `table`, `block.registers[2]`; empty for none.
    path: String,
    /// The array, vector or matrix.
    from: TypeId,
    index: Id,
    /// The composite's offset in bytes from the beginning of the block, where it is known.
    offset: Option<u64>,
}

impl Program {
    /// The index that was out of bounds in an access that trapped, described and as data.
    /// `last_out_of_bounds` returns, for an operation that computes an index, when it last was out
    /// of bounds, and its value.
    pub(crate) fn out_of_bounds_index(
        &self,
        trap: LaneTrap,
        fault_value: u64,
        accessed: Option<&AccessFault>,
        last_out_of_bounds: impl Fn(OpIndex) -> Option<(u64, u32)>,
    ) -> Option<(String, IndexOperand)> {
        match trap.code {
            TrapCode::IndexOutOfBounds => {
                let found =
                    self.indices(trap.op).into_iter().filter_map(|at| Some((last_out_of_bounds(at)?, at)));
                // The last one that was out of bounds caused this trap.
                let ((_, index), at) = found.max()?;
                self.computed_index(at, index, accessed)
            }
            TrapCode::BufferOutOfBounds => self.element_index(trap.op, fault_value, accessed?),
            _ => None,
        }
    }

    /// The operations that compute the indices of an access.
    fn indices(&self, op: OpIndex) -> Vec<OpIndex> {
        let mut found = Vec::new();
        let mut work: Vec<Reg> = Vec::new();
        let mut seen: Vec<Reg> = Vec::new();
        let reads = |op: &Op, work: &mut Vec<Reg>| {
            op.accesses(|access| {
                if let Access::Read(first, count) = access {
                    work.extend((0..count).map(|word| first.plus(word)));
                }
            });
        };
        reads(&self.ops[op.index()], &mut work);
        while let Some(reg) = work.pop() {
            if seen.contains(&reg) {
                continue;
            }
            seen.push(reg);
            for (at, writer) in self.ops.iter().enumerate() {
                if let Some(offset) = writer.computed_offset().filter(|offset| offset.to == reg) {
                    found.push(OpIndex::new(at));
                    work.extend(offset.base);
                }
                work.extend(writer.copy().filter(|copy| copy.to == reg).map(|copy| copy.from));
            }
        }
        found
    }

    fn computed_index(
        &self,
        at: OpIndex,
        index: u32,
        accessed: Option<&AccessFault>,
    ) -> Option<(String, IndexOperand)> {
        let ComputedOffset { length, stride, .. } = self.ops[at.index()].computed_offset()?;
        let chain_indices = self.chain_indices(self.origins[at.index()].offset);
        let may_be_it = |chain_index: &&ChainIndex| {
            let constant = self.module.scalar_value(chain_index.index).map(|known| known as u32);
            constant.is_none_or(|known| known == index)
                && match length {
                    Length::Known(length) => {
                        self.count(chain_index.from).is_none_or(|count| count == u64::from(length))
                    }
                    Length::Unknown => self.count(chain_index.from).is_none(),
                }
        };
        let mut candidates = chain_indices.iter().filter(may_be_it);
        let (first, others) = (candidates.next()?, candidates.count());
        // The bytes of a runtime array are those of its buffer.
        if let (0, None, Some(offset), Some(&AccessFault::Buffer { size, .. })) =
            (others, self.count(first.from), first.offset, accessed)
        {
            return Some(self.element(first, index, [offset, u64::from(stride.max(1)), size]));
        }
        let (operand, length) = (self.index_operand(first, index), self.count(first.from));
        let (index, path) = (describe_value(&operand), self.describe_path(first));
        let text = match (others, length) {
            (0, Some(_)) => format!("{index} of {path}, which has {}", self.describe_count(first.from)),
            (0, None) => format!("{index} of {path}"),
            // Several dimensions have the same length: the message names the whole array.
            (_, Some(_)) => {
                format!("{index} of a dimension of {path} with {}", self.describe_count(first.from))
            }
            (_, None) => format!("{index} of an array within {path}"),
        };
        Some((text + &self.describe_hit_ids(first.index), IndexOperand { length, ..operand }))
    }

    /// The index of the element of a runtime array at which an access was beyond the end of its
    /// buffer.
    fn element_index(
        &self,
        op: OpIndex,
        fault_value: u64,
        accessed: &AccessFault,
    ) -> Option<(String, IndexOperand)> {
        let AccessFault::Buffer { size, .. } = *accessed else { return None };
        let index = self.ops[op.index()].accessed_chunk()?.index?;
        let (at, stride) =
            self.ops.iter().enumerate().find_map(|(at, op)| match op.computed_offset()? {
                ComputedOffset { to, base: None, length: Length::Unknown, stride, .. } => {
                    (to == index).then_some((at, stride))
                }
                _ => None,
            })?;
        let chain_indices = self.chain_indices(self.origins[at].offset);
        // The last runtime array is that of the block; an array of blocks may precede it.
        let chain_index = chain_indices.iter().rfind(|chain_index| self.count(chain_index.from).is_none())?;
        let (offset, stride) = (chain_index.offset?, u64::from(stride.max(1)));
        let index = u32::try_from(fault_value.checked_sub(offset)? / stride).ok()?;
        Some(self.element(chain_index, index, [offset, stride, size]))
    }

    /// Describes an element of a runtime array, given the array's offset in its buffer, the bytes
    /// of an element and the size of the buffer.
    fn element(
        &self,
        chain_index: &ChainIndex,
        index: u32,
        [offset, stride, size]: [u64; 3],
    ) -> (String, IndexOperand) {
        let count = size.saturating_sub(offset) / stride;
        let elements = if count == 1 { "element" } else { "elements" };
        let operand = self.index_operand(chain_index, index);
        let (told, path) = (describe_value(&operand), self.describe_path(chain_index));
        let ids = self.describe_hit_ids(chain_index.index);
        let text = format!("{told} of {path}, which has {count} {elements} in this buffer{ids}");
        // An index below 0 is before the array, and one beyond 32 bits is not known.
        let at = operand.index.and_then(|index| u64::try_from(index).ok());
        let offset = at.map(|at| offset.saturating_add(at.saturating_mul(stride)));
        (text, IndexOperand { length: Some(count), offset, ..operand })
    }

    /// Which ids of a hit an index is made of, if any.
    fn describe_hit_ids(&self, index: Id) -> String {
        let ids = HitIds::new(&self.module);
        let names = |among: Vec<HitId>| among.into_iter().map(HitId::name).collect::<Vec<_>>().join(" and ");
        match (ids.same(index), ids.among(index)) {
            (Some(id), _) => format!("; the index is {}", id.name()),
            (None, among) if !among.is_empty() => format!("; the index is computed from {}", names(among)),
            _ => String::new(),
        }
    }

    /// The value of an index by its type; the length is still to be told.
    fn index_operand(&self, chain_index: &ChainIndex, value: u32) -> IndexOperand {
        let index = match self.module.type_of(chain_index.index).map(|ty| self.module.ty(ty)) {
            Some(Type::Int { width: 64, .. }) if value == u32::MAX => None,
            Some(Type::Int { signed: true, .. }) => Some(i64::from(value as i32)),
            _ => Some(i64::from(value)),
        };
        let of = Some(&chain_index.path).filter(|path| !path.is_empty()).cloned();
        IndexOperand { index, length: None, of, offset: None }
    }

    /// The length of a composite type; `None` where it depends on a buffer or a binding.
    fn count(&self, ty: TypeId) -> Option<u64> {
        match *self.module.ty(ty) {
            Type::Array { length, .. } => self.module.scalar_value(length),
            Type::Vector { count, .. } | Type::Matrix { count, .. } => Some(count.into()),
            _ => None,
        }
    }

    fn describe_count(&self, ty: TypeId) -> String {
        let count = self.count(ty).unwrap_or(0);
        let part = match self.module.ty(ty) {
            Type::Vector { .. } => "component",
            Type::Matrix { .. } => "column",
            _ => "element",
        };
        format!("{count} {part}{}", if count == 1 { "" } else { "s" })
    }

    /// The source expression of what an index indexes, or what it is.
    fn describe_path(&self, chain_index: &ChainIndex) -> String {
        match self.module.ty(chain_index.from) {
            _ if !chain_index.path.is_empty() => format!("`{}`", chain_index.path),
            Type::Vector { .. } => "a vector".to_owned(),
            Type::Matrix { .. } => "a matrix".to_owned(),
            _ => "an array".to_owned(),
        }
    }

    /// The indices of the instruction at a word offset, except for those of struct members.
    fn chain_indices(&self, offset: u32) -> Vec<ChainIndex> {
        let words = &self.module.words;
        let Some(&head) = words.get(offset as usize) else { return Vec::new() };
        let end = (offset as usize + (head >> 16) as usize).min(words.len());
        let operands = &words[(offset as usize + 3).min(end)..end];
        let vector = |vector: u32, index: u32| {
            let from = self.module.type_of(Id(vector));
            let path = self.path(Id(vector)).unwrap_or_default();
            let chain_index = |from| ChainIndex { path, from, index: Id(index), offset: None };
            from.map(chain_index).into_iter().collect()
        };
        let opcode = Opcode::of_word(head);
        if let Some(chain) = AccessChain::of(opcode, operands) {
            return self.follow_indices(chain).0;
        }
        match (opcode, operands) {
            (Opcode::VectorExtractDynamic, &[from, index]) => vector(from, index),
            (Opcode::VectorInsertDynamic, &[from, _, index]) => vector(from, index),
            _ => Vec::new(),
        }
    }

    /// Follows indices from a pointer on: returns those into arrays, vectors and matrices, and the
    /// source expression of the part that they lead to.
    fn follow_indices(&self, chain: AccessChain<'_>) -> (Vec<ChainIndex>, String) {
        self.follow_indices_from(self.path(chain.base).unwrap_or_default(), chain)
    }

    /// As [`Program::follow_indices`], given the source expression of the base.
    fn follow_indices_from(&self, mut path: String, chain: AccessChain<'_>) -> (Vec<ChainIndex>, String) {
        let module = &self.module;
        let mut chain_indices = Vec::new();
        let Some(mut ty) = module.chain_type(chain) else { return (chain_indices, path) };
        let is_variable = matches!(module.definition(chain.base), Some(Definition::Variable(_)));
        let mut offset = is_variable.then_some(0u64);
        for &index in chain.indices {
            let known = module.scalar_value(Id(index));
            match module.ty(ty) {
                Type::Struct { members, .. } => {
                    let Some((at, member)) = known.and_then(|at| Some((at, members.get(at as usize)?)))
                    else {
                        break;
                    };
                    let id = module.id_of_type(ty);
                    let name = id.and_then(|id| module.debug_info.member_names.get(&(id, at as u32)));
                    let name = name.filter(|name| !name.is_empty());
                    // naga and slangc wrap an array in a struct, whose member no source names.
                    let is_wrapper =
                        members.len() == 1 && name.is_none_or(|name| name.starts_with("__member"));
                    if !path.is_empty() && !is_wrapper {
                        path += &name.map_or_else(|| format!(".member{at}"), |name| format!(".{name}"));
                    }
                    offset = offset.zip(member.offset).map(|(sum, more)| sum + u64::from(more));
                    ty = member.ty;
                    continue;
                }
                &(Type::Array { element: part, .. }
                | Type::RuntimeArray { element: part, .. }
                | Type::Vector { component: part, .. }
                | Type::Matrix { column: part, .. }) => {
                    // Each block of an array has a buffer of its own.
                    let blocks = matches!(module.ty(part), Type::Struct { block: true, .. });
                    let path = path.clone();
                    chain_indices.push(ChainIndex { path, from: ty, index: Id(index), offset });
                    offset = offset.filter(|_| blocks);
                    ty = part;
                }
                _ => break,
            }
            if !path.is_empty() {
                path += &known.map_or_else(|| "[]".to_owned(), |at| format!("[{at}]"));
            }
        }
        (chain_indices, path)
    }

    /// The source expression of what an `OpStore` writes to; `None` for other operations.
    #[doc(hidden)]
    pub fn stored_path(&self, op: OpIndex) -> Option<String> {
        let words = self.module.words.get(self.origins.get(op.index())?.offset as usize..)?;
        match words {
            [head, pointer, ..] if Opcode::of_word(*head) == Opcode::Store => self.path(Id(*pointer)),
            _ => None,
        }
    }

    /// The source expression of what an operation accesses through a pointer that the shader has
    /// loaded or computed, which begins with the name of the type that the pointer leads to:
    /// `Node.children[].mass`; `None` where that has no name.
    #[doc(hidden)]
    pub fn pointee_path(&self, op: OpIndex) -> Option<String> {
        let words = self.module.words.get(self.origins.get(op.index())?.offset as usize..)?;
        let pointer = match Opcode::of_word(*words.first()?) {
            Opcode::Store | Opcode::AtomicStore => words.get(1)?,
            opcode if opcode == Opcode::Load || atomic::OPCODES.contains(&opcode) => words.get(3)?,
            _ => return None,
        };
        let type_name = |pointer: Id| {
            let ty = self.module.pointee(pointer)?;
            self.module.name(self.module.id_of_type(ty)?).map(str::to_owned)
        };
        let made = self.module.result_instruction(Id(*pointer));
        match made.and_then(|made| self.module.access_chain(made)) {
            Some(chain) => Some(self.follow_indices_from(type_name(chain.base)?, chain).1),
            None => type_name(Id(*pointer)),
        }
    }

    /// The source expression of a variable, or of a part of one.
    fn path(&self, id: Id) -> Option<String> {
        let module = &self.module;
        if let Some(name) = module.name(id) {
            return Some(name.to_owned());
        }
        match module.definition(id)? {
            Definition::Result(..) => {
                let chain = module.access_chain(module.result_instruction(id)?)?;
                let path = self.follow_indices(chain).1;
                Some(path).filter(|path| chain.element.is_none() && !path.is_empty())
            }
            Definition::Variable(_) => {
                // A block without an instance name has the name of its type.
                module.name(module.id_of_type(module.pointee(id)?)?).map(str::to_owned)
            }
            _ => None,
        }
    }
}

fn describe_value(operand: &IndexOperand) -> String {
    operand.index.map_or_else(|| "an index beyond 32 bits".to_owned(), |index| format!("index {index}"))
}
