//! What bits are drawn for a word whose value is open: those that its type can have.

use anyhit_engine::math::random::Random;
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_engine::ops::pointer::pointer_word_count;

/// What a word of a value in registers is, as far as bits may be drawn for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WordKind {
    /// A handle or an address: it stays as it is.
    Kept,
    /// 0 or 1.
    Bool,
    /// An integer of a width, or half of one.
    Integer(u32),
    /// A float of a width, or half of one.
    Float(u32),
}

impl WordKind {
    /// The kind of the words of a kernel's result; `width` is that of its instruction's scalars.
    pub(super) fn of_result(kernel: &LaneKernel, width: u32) -> Self {
        if kernel.float_result > 0 { Self::Float(kernel.float_result) } else { Self::Integer(width) }
    }

    /// Draws a word: any bits, or a number as shaders have them.
    pub(super) fn draw(self, random: &mut Random) -> Option<u32> {
        let bits = random.bits();
        let any = (bits >> 32) as u32;
        let is_small = bits & 1 == 0;
        Some(match self {
            Self::Kept => return None,
            Self::Bool => any & 1,
            Self::Integer(32..) if !is_small => any,
            // Narrow integers are extended in their registers: small ones, whether signed or not.
            Self::Integer(_) => any & 0x7,
            Self::Float(32) if is_small => (random.unit() * 4.0 - 2.0).to_bits(),
            Self::Float(32..) => any,
            Self::Float(width) => any & ((1 << width) - 1),
        })
    }

    /// Appends the kinds of the words of a type.
    pub(super) fn of_type(module: &Module, ty: TypeId, kinds: &mut Vec<Self>) {
        match *module.ty(ty) {
            Type::Bool => kinds.push(Self::Bool),
            Type::Int { width, .. } => kinds.extend(vec![Self::Integer(width); width.div_ceil(32) as usize]),
            Type::Float { width, .. } => kinds.extend(vec![Self::Float(width); width.div_ceil(32) as usize]),
            Type::Vector { component: part, count } | Type::Matrix { column: part, count } => {
                (0..count).for_each(|_| Self::of_type(module, part, kinds));
            }
            Type::Array { element, length, .. } => {
                let mut one = Vec::new();
                Self::of_type(module, element, &mut one);
                let count = module.scalar_value(length).unwrap_or(0);
                (0..count).for_each(|_| kinds.extend(&one));
            }
            Type::Struct { ref members, .. } => {
                members.iter().for_each(|member| Self::of_type(module, member.ty, kinds));
            }
            Type::AccelerationStructure => kinds.extend([Self::Kept; 2]),
            Type::Pointer { storage_class, .. } => {
                kinds.extend(vec![Self::Kept; pointer_word_count(storage_class) as usize]);
            }
            _ => kinds.push(Self::Kept),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_drawn_as_their_type_has_them() {
        let mut random = Random::new(1);
        let mut draw = |kind: WordKind| (0..200).filter_map(|_| kind.draw(&mut random)).collect::<Vec<u32>>();
        assert!(draw(WordKind::Kept).is_empty());
        assert!(draw(WordKind::Bool).iter().all(|&word| word <= 1));
        assert!(draw(WordKind::Integer(8)).iter().all(|&word| word < 0x80));
        assert!(draw(WordKind::Float(16)).iter().all(|&word| word <= 0xFFFF));
        let floats = draw(WordKind::Float(32));
        assert!(floats.iter().any(|&word| f32::from_bits(word).abs() > 2.0));
        assert!(floats.iter().filter(|&&word| f32::from_bits(word).abs() <= 2.0).count() > 80);
    }
}
