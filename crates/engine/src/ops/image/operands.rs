//! Image operands (SPIR-V 3.14).

use crate::machine::Reg;
use crate::machine::format::Class;
use crate::math::array;
use crate::module::ty::Type;
use crate::module::{Id, Instruction};
use crate::ops::conversion::{self, Conversion};
use crate::ops::image::filter::Lod;
use crate::ops::image::reader::LaneReader;
use crate::ops::image::view::View;
use crate::ops::integer_operand::ReadAs;
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

const BIAS: u32 = 0x1;
const LOD: u32 = 0x2;
const GRAD: u32 = 0x4;
const CONST_OFFSET: u32 = 0x8;
const OFFSET: u32 = 0x10;
const CONST_OFFSETS: u32 = 0x20;
const SAMPLE: u32 = 0x40;
const MIN_LOD: u32 = 0x80;
const MAKE_TEXEL_AVAILABLE: u32 = 0x100;
const MAKE_TEXEL_VISIBLE: u32 = 0x200;
const NON_PRIVATE_TEXEL: u32 = 0x400;
const VOLATILE_TEXEL: u32 = 0x800;
const SIGN_EXTEND: u32 = 0x1000;
const ZERO_EXTEND: u32 = 0x2000;
const NONTEMPORAL: u32 = 0x4000;
const OFFSETS: u32 = 0x10000;

/// The image operands of an instruction. Operands for caches and visibility are ignored: texels are
/// shared directly.
#[derive(Clone, Debug, Default)]
pub struct Operands {
    /// Added to an implicit level of detail.
    pub bias: Option<Reg>,
    /// Level of detail: a float, or an integer for a fetch.
    pub lod: Option<Reg>,
    /// Derivatives along x and y.
    pub gradients: Option<[Words; 2]>,
    /// `ConstOffset` or `Offset`.
    pub offset: Option<Words>,
    /// `ConstOffsets` or `Offsets`: four offsets of two components.
    pub offsets: Option<Words>,
    /// The sample's number.
    pub sample: Option<Reg>,
    /// Least level of detail.
    pub min_lod: Option<Reg>,
    /// `SignExtend` or `ZeroExtend`, in place of the sign of `Sampled Type`.
    pub class: Option<Class>,
}

impl Operands {
    /// Returns the view that an instruction with these operands has of an image.
    pub fn view(&self, declared: View) -> View {
        View { class: self.class.unwrap_or(declared.class), ..declared }
    }

    /// Reads the operands, starting with the mask at operand `at`; `implicit` says whether the
    /// instruction has an implicit level of detail.
    ///
    /// # Errors
    /// `InvalidModule` for `Bias`, which needs an implicit level of detail; `UnsupportedModule` for
    /// unknown bits.
    pub fn read(
        translator: &mut Translator<'_>,
        instruction: &Instruction,
        at: usize,
        implicit: bool,
    ) -> Result<Self> {
        let mut operands = Self::default();
        let Some((&mask, ids)) = translator.operands(instruction).get(at..).and_then(<[u32]>::split_first)
        else {
            return Ok(operands);
        };
        let mut ids = ids.iter();
        let mut words = |translator: &mut Translator<'_>| match ids.next() {
            Some(&id) => numeric_components(translator, Id(id)),
            None => Err(translator.invalid("an image operand is missing")),
        };
        if mask & BIAS != 0 && implicit {
            operands.bias = words(translator)?.first().copied();
        } else if mask & BIAS != 0 {
            return Err(translator.invalid(
                "the image operand Bias requires an instruction with an implicit level of detail (SPIR-V 3.14)",
            ));
        }
        if mask & LOD != 0 {
            operands.lod = words(translator)?.first().copied();
        }
        if mask & GRAD != 0 {
            operands.gradients = Some([words(translator)?, words(translator)?]);
        }
        for bit in [CONST_OFFSET, OFFSET] {
            if mask & bit != 0 {
                operands.offset = Some(words(translator)?);
            }
        }
        if mask & CONST_OFFSETS != 0 {
            operands.offsets = Some(words(translator)?);
        }
        if mask & SAMPLE != 0 {
            operands.sample = words(translator)?.first().copied();
        }
        if mask & MIN_LOD != 0 {
            operands.min_lod = words(translator)?.first().copied();
        }
        for bit in [MAKE_TEXEL_AVAILABLE, MAKE_TEXEL_VISIBLE] {
            if mask & bit != 0 {
                words(translator)?;
            }
        }
        if mask & OFFSETS != 0 {
            operands.offsets = Some(words(translator)?);
        }
        operands.class = match mask & (SIGN_EXTEND | ZERO_EXTEND) {
            0 => None,
            SIGN_EXTEND => Some(Class::Sint),
            ZERO_EXTEND => Some(Class::Uint),
            _ => return Err(translator.invalid("the image operands contain both SignExtend and ZeroExtend")),
        };
        let known = BIAS
            | LOD
            | GRAD
            | CONST_OFFSET
            | OFFSET
            | CONST_OFFSETS
            | SAMPLE
            | MIN_LOD
            | MAKE_TEXEL_AVAILABLE
            | MAKE_TEXEL_VISIBLE
            | NON_PRIVATE_TEXEL
            | VOLATILE_TEXEL
            | SIGN_EXTEND
            | ZERO_EXTEND
            | NONTEMPORAL
            | OFFSETS;
        if mask & !known != 0 {
            return Err(
                translator.unsupported(format!("image operands {:#x} are not supported", mask & !known))
            );
        }
        if operands.offset.as_ref().is_some_and(|offset| offset.len() > 3)
            || operands.offsets.as_ref().is_some_and(|offsets| offsets.len() != 8)
        {
            return Err(
                translator.invalid("texel offsets must have one to three components, or be four pairs")
            );
        }
        Ok(operands)
    }

    /// The source of the level of detail of a lane.
    pub fn lane_lod<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> Lod {
        match &self.gradients {
            Some(given) => Lod::Gradients(array::map([0, 1], |way: usize| {
                array::from_fn(|axis| given[way].get(axis).map_or(0.0, |&reg| reader.float(reg)))
            })),
            None => Lod::Explicit(self.lod.map_or(0.0, |reg| reader.float(reg))),
        }
    }

    /// `Bias` and `MinLod` of a lane.
    pub fn bias_and_min_lod<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> [f32; 2] {
        array::map([self.bias, self.min_lod], |reg| reg.map_or(0.0, |reg| reader.float(reg)))
    }

    /// `ConstOffset` or `Offset` of a lane, 0 where there is none.
    pub fn texel_offset<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> [i32; 3] {
        let part = |axis: usize| self.offset.as_ref().and_then(|offset| offset.get(axis));
        array::from_fn(|axis| part(axis).map_or(0, |&reg| reader.integer(reg)))
    }

    /// The registers that are read.
    pub fn registers(&self) -> impl Iterator<Item = Reg> {
        let single = [self.bias, self.lod, self.sample, self.min_lod].into_iter().flatten();
        let gradients = self.gradients.iter().flatten().flatten().copied();
        let offsets = [&self.offset, &self.offsets].into_iter().flatten().flatten().copied();
        single.chain(gradients).chain(offsets)
    }
}

/// The components of a number of any width: integers as one word each, floats in 32 bits.
///
/// # Errors
/// `UnsupportedModule` for arrays of numbers of other than 32 bits.
pub fn numeric_components(translator: &mut Translator<'_>, id: Id) -> Result<Words> {
    let ty = translator.type_of(id)?;
    let scalar = match *translator.module.ty(ty) {
        Type::Vector { component, .. } => component,
        _ => ty,
    };
    match *translator.module.ty(scalar) {
        Type::Int { .. } => translator.integers(id, ReadAs::Coordinate),
        Type::Float { .. } => {
            let (components, width) = translator.components_of_width(id)?;
            let Some(kernel) = conversion::kernel(Conversion::F, width, 32) else { return Ok(components) };
            components.iter().map(|&component| translator.emit_kernel(kernel, &[component])).collect()
        }
        _ => translator.words(id),
    }
}

impl PartialEq for Operands {
    fn eq(&self, other: &Self) -> bool {
        self.class == other.class && self.registers().eq(other.registers())
    }
}
