//! A texel, named by integer coordinates.

use crate::machine::format::Component;
use crate::machine::image::{Image, Position};
use crate::machine::{AccessFault, Batch, Bindings, Reg, TrapCode};
use crate::ops::image::reader::LaneReader;
use crate::ops::image::view::View;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// A texel, named by integer coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct TexelRef {
    /// The declared view of the image.
    pub view: View,
    /// The image's handle.
    pub image: Reg,
    /// Column, row, slice, then layer or cube face, as many as the dimension has.
    pub coordinate: Words,
    /// The offset that is added to the column, row and slice.
    pub offset: Option<Words>,
    /// The mip level.
    pub level: Option<Reg>,
    /// The sample.
    pub sample: Option<Reg>,
}

impl TexelRef {
    /// The registers that are read.
    pub fn registers(&self) -> impl Iterator<Item = Reg> {
        let optional = self.level.into_iter().chain(self.sample);
        let offset = self.offset.iter().flatten().copied();
        [self.image].into_iter().chain(self.coordinate.iter().copied()).chain(optional).chain(offset)
    }

    /// The image of a lane, and the texel's index in it.
    ///
    /// # Errors
    /// As [`View::texels`], and `ImageOutOfBounds`: every texel of a null image is outside.
    pub fn resolve<'b, const W: usize>(
        &self,
        reader: LaneReader<'_, 'b, W>,
    ) -> Result<(&'b Image, usize), TrapCode> {
        let image = reader.texels(self.view, self.image)?;
        if image.is_null() {
            return Err(TrapCode::ImageOutOfBounds);
        }
        let mut position = Position::default();
        let axes = self.view.dimension.axes();
        for (axis, coordinate) in self.coordinates(reader).enumerate() {
            *if axis < axes { &mut position.at[axis] } else { &mut position.layer } = coordinate;
        }
        position.level = self.level.map_or(0, |reg| reader.word(reg));
        position.sample = self.sample.map_or(0, |reg| reader.word(reg));
        let outside = || match image.contains(&position) {
            true => TrapCode::ImageRowAbsent,
            false => TrapCode::ImageOutOfBounds,
        };
        Ok((image, image.index(&position).ok_or_else(outside)?))
    }

    /// Returns whether an access outside the image traps.
    pub fn traps_outside<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> bool {
        reader.bindings.traps_outside_images && !reader.image(self.view, self.image).is_ok_and(Image::is_null)
    }

    /// The coordinates with the offset added; layers and faces have no offset.
    fn coordinates<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> impl Iterator<Item = i64> {
        let axes = self.view.dimension.axes();
        self.coordinate.iter().enumerate().map(move |(axis, &reg)| {
            let offset = self.offset.as_ref().and_then(|offset| offset.get(axis)).filter(|_| axis < axes);
            // A signed coordinate below 0 and an unsigned one above 2^31 are both outside.
            i64::from(reader.integer(reg)) + offset.map_or(0, |&reg| i64::from(reader.integer(reg)))
        })
    }

    /// Stores the coordinates of the lane, for the report of its trap.
    #[cold]
    pub fn record_fault<const W: usize>(&self, batch: &mut Batch<W>, lane: usize, bindings: &Bindings) {
        let fault = self.fault(LaneReader::new(&batch.registers, lane, bindings));
        batch.record_access_fault(lane, fault);
    }

    /// Returns the coordinates of a lane, and the image that they are outside of.
    #[cold]
    pub fn fault<const W: usize>(&self, reader: LaneReader<'_, '_, W>) -> AccessFault {
        let handle = reader.word(self.image);
        let axes = self.view.dimension.axes();
        match self.view.texels(reader.bindings, handle) {
            Err(_) => self.view.fault(reader.bindings, handle),
            Ok(image) => {
                let shape = image.shape();
                let level = self.level.map_or(0, |reg| reader.word(reg));
                let layer = self.coordinate.len() > axes;
                let sides = shape.level_extent(level.min(shape.levels - 1));
                AccessFault::Texel {
                    handle,
                    coordinate: self.coordinates(reader).collect(),
                    extent: sides[..axes].iter().copied().chain(layer.then_some(shape.layers)).collect(),
                    level: [level, shape.levels],
                    sample: [self.sample.map_or(0, |reg| reader.word(reg)), shape.samples],
                }
            }
        }
    }

    /// Does what [`TexelRef::resolve`] does for atomic instructions: the texel must have the size
    /// of the scalar that the pointer points to, or be the vector of that many 16-bit floats.
    ///
    /// # Errors
    /// As [`TexelRef::resolve`], and `ImageMismatch` for a texel of another size.
    pub fn resolve_atomic<'b, const W: usize>(
        &self,
        reader: LaneReader<'_, 'b, W>,
        components: u32,
    ) -> Result<(&'b Image, usize), TrapCode> {
        let (image, index) = self.resolve(reader)?;
        let size = if self.view.wide { 8 } else { 4 };
        let format = image.format();
        let fits = match components {
            1 => format.texel_size() == size && format.channels == 1,
            _ => format.component == Component::Float16 && u32::from(format.channels) == components,
        };
        if fits { Ok((image, index)) } else { Err(TrapCode::ImageMismatch) }
    }
}
