//! Reads a lane's operands of image instructions: words of its registers, and the descriptors that
//! they name.

use crate::machine::image::Image;
use crate::machine::sampler::Sampler;
use crate::machine::{Bindings, Descriptor, Reg, Registers, TrapCode};
use crate::ops::image::view::View;
use crate::ops::memory::OUT_OF_BOUNDS;

/// The registers of a lane, and the bindings for its handles.
#[derive(Clone, Copy, Debug)]
pub struct LaneReader<'r, 'b, const W: usize> {
    registers: &'r Registers<W>,
    lane: usize,
    /// The bindings in which handles are looked up.
    pub bindings: &'b Bindings,
}

impl<'r, 'b, const W: usize> LaneReader<'r, 'b, W> {
    /// The reader of a lane.
    pub fn new(registers: &'r Registers<W>, lane: usize, bindings: &'b Bindings) -> Self {
        Self { registers, lane, bindings }
    }

    /// A word.
    pub fn word(&self, reg: Reg) -> u32 {
        self.registers[reg].0[self.lane]
    }

    /// A word, as a signed number.
    pub fn integer(&self, reg: Reg) -> i32 {
        self.word(reg) as i32
    }

    /// A word, as a float.
    pub fn float(&self, reg: Reg) -> f32 {
        f32::from_bits(self.word(reg))
    }

    /// Two words, the low one first.
    pub fn wide(&self, reg: Reg) -> u64 {
        u64::from(self.word(reg)) | u64::from(self.word(reg.plus(1))) << 32
    }

    /// The image whose handle is in a register; see [`View::image`].
    pub fn image(&self, view: View, handle: Reg) -> Result<&'b Image, TrapCode> {
        view.image(self.bindings, self.word(handle))
    }

    /// The image whose handle is in a register, with its texels; see [`View::texels`].
    pub fn texels(&self, view: View, handle: Reg) -> Result<&'b Image, TrapCode> {
        view.texels(self.bindings, self.word(handle))
    }

    /// The sampler whose handle is in a register.
    ///
    /// # Errors
    /// `DescriptorMissing`, `IndexOutOfBounds`
    pub fn sampler(&self, handle: Reg) -> Result<&'b Sampler, TrapCode> {
        let sampler = |descriptor| match descriptor {
            &Descriptor::Sampler(ref sampler) | &Descriptor::ImageSampler(_, ref sampler) => Some(&**sampler),
            _ => None,
        };
        let handle = self.word(handle);
        let found = self.bindings.descriptor(handle);
        let missing =
            if handle == OUT_OF_BOUNDS { TrapCode::IndexOutOfBounds } else { TrapCode::DescriptorMissing };
        found.and_then(|descriptor| descriptor.find(sampler)).ok_or(missing)
    }
}
