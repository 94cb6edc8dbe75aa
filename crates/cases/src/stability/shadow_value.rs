//! The shadow value of a register.

/// The shadow value of a word, or of the two words of a 64-bit number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ShadowValue {
    /// The bits of the register when the shadow was set. If the register holds other bits by now,
    /// an operation without a shadow wrote it, and the shadow value is invalid.
    pub bits: u64,
    /// The value without f32 rounding; 0 or 1 for a Boolean, the number for an integer.
    pub value: f64,
}
