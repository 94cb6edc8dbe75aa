//! Which row of an image each invocation of a launch accesses: if it is its own row, the image need
//! not be in memory as a whole.

use super::{AffineRange, LaunchExtent, Memory, MemoryAccess, StoredMemory, Symbol, ValueTracking};
use crate::machine::Binding;
use crate::ops::image::ImageOp;
use crate::ops::op::Op;
use crate::ops::shared_access::SharedPart;
use crate::program::Program;

/// The only row of an image that an invocation accesses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OwnRow {
    /// The row of its launch index: y.
    Same,
    /// Counted from the other end: the launch's height - 1 - y.
    Mirrored,
}

impl LaunchExtent<'_> {
    /// The row of the image at a binding that programs access, by loads, stores or atomic
    /// instructions. Queries of the image's size do not count.
    ///
    /// # Errors
    /// The first program that may access another row, or an unknown one.
    pub fn own_row<'p>(
        &self,
        programs: &[&'p Program],
        binding: Binding,
    ) -> std::result::Result<OwnRow, &'p Program> {
        let accesses: Vec<&MemoryAccess> = programs.iter().flat_map(|program| &program.accesses).collect();
        let stored = StoredMemory::new(self, &accesses);
        let mut row = None;
        for &program in programs.iter().filter(|program| program.bindings().any(|one| one == binding)) {
            for reached in texels(program, binding) {
                let found = reached.and_then(|range| self.row(&range, &stored)).ok_or(program)?;
                if *row.get_or_insert(found) != found {
                    return Err(program);
                }
            }
        }
        Ok(row.unwrap_or(OwnRow::Same))
    }

    /// The row that a coordinate selects.
    fn row(&self, coordinate: &AffineRange, stored: &StoredMemory) -> Option<OwnRow> {
        if !self.keeps_bounds(coordinate, &|binding| stored.may_change(binding)) {
            return None;
        }
        // Coordinates have 32 bits and wrap around.
        let (mut constant, mut by) = (0_u32, 0_u32);
        for (symbols, factor) in &coordinate.from.0 {
            let (mut product, mut varies) = (*factor as u32, false);
            for symbol in symbols {
                match *symbol {
                    Symbol::Size(axis) => product = product.wrapping_mul(self.count[axis as usize]),
                    Symbol::Word(place, offset) => {
                        let changes = place.is_some_and(|(binding, _)| stored.may_change(binding));
                        let word = self.word(place, offset).filter(|_| !changes)?;
                        product = product.wrapping_mul(word);
                    }
                    // The only value is 0.
                    Symbol::Index(axis) if self.count[axis as usize] <= 1 => product = 0,
                    Symbol::Index(1) if !varies => varies = true,
                    Symbol::Index(_) | Symbol::Local(_) => return None,
                }
            }
            let sum = if varies { &mut by } else { &mut constant };
            *sum = sum.wrapping_add(product);
        }
        let height = self.count[1];
        match (by, constant) {
            (1, 0) => Some(OwnRow::Same),
            (0, 0) if height == 1 => Some(OwnRow::Same),
            (u32::MAX, last) if last == height.wrapping_sub(1) => Some(OwnRow::Mirrored),
            _ => None,
        }
    }
}

/// The row of every access of a program to a texel of the image at a binding, where `None` stands
/// for an unknown row or several rows.
fn texels(program: &Program, binding: Binding) -> Vec<Option<AffineRange>> {
    let mut values = ValueTracking::new(program);
    let here = |memory: Memory| [Memory::Binding(binding), Memory::Unknown].contains(&memory);
    let mut rows = Vec::new();
    for op in &program.ops {
        if let Op::Image(ImageOp::Footprint(op)) = op
            && here(values.handle(op.image))
        {
            rows.push(None);
        }
        let mut texel = None;
        op.shared_accesses(&mut |_, part| match part {
            SharedPart::Texel(one) => texel = Some(one),
            // A sample may read several rows, and image processing reads several images.
            SharedPart::Texels { image, .. } if here(values.handle(image)) => rows.push(None),
            SharedPart::Texels { .. } | SharedPart::Bytes(_) => {}
        });
        let Some(place) = texel.filter(|texel| here(values.handle(texel.image))) else { continue };
        // The column does not matter: outside the image the access traps, or is ignored.
        let plain = place.offset.is_none() && place.level.is_none() && place.sample.is_none();
        let row = place.coordinate.get(1).filter(|_| plain).and_then(|&row| values.value(row));
        let row = row.filter(|row| row.count == 1);
        if !rows.contains(&row) {
            rows.push(row);
        }
    }
    rows
}
