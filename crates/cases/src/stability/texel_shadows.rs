//! The f64 shadows of texels: a float that is stored in an image and read again is compared with
//! what it was before its format rounded it.

use crate::stability::shadow_context::Memory;
use crate::stability::shadow_value::ShadowValue;
use crate::stability::shadows::{ShadowFrame, bits};
use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::Image;
use anyhit_engine::machine::{Batch, Bindings, Reg};
use anyhit_engine::ops::image::access::{TexelRead, TexelWrite};
use anyhit_engine::ops::image::reader::LaneReader;
use anyhit_engine::ops::image::texel_ref::TexelRef;

/// A component of a texel that was read.
#[derive(Clone, Copy, Debug)]
pub(super) struct TexelComponent {
    /// Its key in [`Memory`].
    pub key: (usize, u64),
    /// The register that holds it.
    pub to: Reg,
    /// Its bits.
    pub bits: u64,
    /// The bits that the format has for it.
    pub width: u32,
}

/// The shadows of a texel that an operation has written, by component.
pub(super) fn stored(frame: &ShadowFrame, batch: &Batch<1>, bindings: &Bindings, op: &TexelWrite) -> Memory {
    let Some((image, texel)) = resolved(batch, bindings, &op.texel) else { return Memory::new() };
    let format = image.format();
    let stored = format.decode(image.load(texel));
    let channels = op.from.iter().zip(stored).enumerate().take(usize::from(format.channels));
    let shadow = |(channel, (&from, stored)): (usize, (&Reg, u64))| {
        let own = bits(batch, from, 1);
        let value = frame.value(from, own).unwrap_or_else(|| f64::from(f32::from_bits(own as u32)));
        (key(image, texel, channel), ShadowValue { bits: stored, value: clamped(format, value) })
    };
    channels.map(shadow).collect()
}

/// The components of a texel that an operation has read.
pub(super) fn read(batch: &Batch<1>, bindings: &Bindings, op: &TexelRead) -> Vec<TexelComponent> {
    let resolved = resolved(batch, bindings, &op.texel);
    let component = |channel: u32| {
        let to = op.to.to.plus(channel);
        let place = resolved.filter(|(image, _)| channel < u32::from(image.format().channels));
        // What the format lacks is exact.
        let key = place.map_or((0, 0), |(image, texel)| key(image, texel, channel as usize));
        let width = place.map_or(32, |(image, _)| width(image.format()));
        TexelComponent { key, to, bits: bits(batch, to, 1), width }
    };
    (0..op.to.registers()).map(component).collect()
}

fn resolved<'b>(batch: &Batch<1>, bindings: &'b Bindings, texel: &TexelRef) -> Option<(&'b Image, usize)> {
    texel.resolve(LaneReader::new(&batch.registers, 0, bindings)).ok()
}

fn key(image: &Image, texel: usize, channel: usize) -> (usize, u64) {
    (std::ptr::from_ref(image).addr(), 4 * texel as u64 + channel as u64)
}

/// The number that a format would store with any number of bits: fixed-point formats clamp.
fn clamped(format: Format, value: f64) -> f64 {
    match format.component {
        Component::Unorm8 | Component::Unorm16 | Component::Unorm10A2 => value.clamp(0.0, 1.0),
        Component::Snorm8 | Component::Snorm16 => value.clamp(-1.0, 1.0),
        Component::Float11B10 | Component::SharedExponent => value.max(0.0),
        _ => value,
    }
}

/// The bits of the largest component of a format.
fn width(format: Format) -> u32 {
    match format.component {
        Component::Unorm8 | Component::Snorm8 => 8,
        Component::SharedExponent => 9,
        Component::Unorm10A2 => 10,
        Component::Float11B10 => 11,
        Component::Unorm16 | Component::Snorm16 | Component::Float16 => 16,
        _ => 32,
    }
}
