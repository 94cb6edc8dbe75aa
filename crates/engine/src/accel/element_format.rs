//! The formats of the numbers that a build reads: of vertices, radii and indices.

use half::f16;

use crate::math::array;

/// `VkFormat` of vertices: the formats that Vulkan requires for acceleration structures, and the
/// three-component ones of 16 bits. A missing z is 0, a fourth component is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VertexFormat {
    /// `VK_FORMAT_R32G32_SFLOAT`
    R32G32Sfloat,
    /// `VK_FORMAT_R32G32B32_SFLOAT`
    R32G32B32Sfloat,
    /// `VK_FORMAT_R16G16_SFLOAT`
    R16G16Sfloat,
    /// `VK_FORMAT_R16G16B16_SFLOAT`
    R16G16B16Sfloat,
    /// `VK_FORMAT_R16G16B16A16_SFLOAT`
    R16G16B16A16Sfloat,
    /// `VK_FORMAT_R16G16_SNORM`
    R16G16Snorm,
    /// `VK_FORMAT_R16G16B16_SNORM`
    R16G16B16Snorm,
    /// `VK_FORMAT_R16G16B16A16_SNORM`
    R16G16B16A16Snorm,
}

/// `VkFormat` of radii: the two that Vulkan requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RadiusFormat {
    /// `VK_FORMAT_R32_SFLOAT`
    R32Sfloat,
    /// `VK_FORMAT_R16_SFLOAT`
    R16Sfloat,
}

/// `VkIndexType` of a build; no index buffer is `VK_INDEX_TYPE_NONE_KHR`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum IndexType {
    /// `VK_INDEX_TYPE_UINT8`: no build supports it, and the error says so.
    Uint8,
    /// `VK_INDEX_TYPE_UINT16`
    Uint16,
    /// `VK_INDEX_TYPE_UINT32`
    Uint32,
}

#[derive(Clone, Copy, PartialEq)]
enum Component {
    Sfloat32,
    Sfloat16,
    Snorm16,
}

impl VertexFormat {
    fn parts(self) -> (Component, usize) {
        match self {
            Self::R32G32Sfloat => (Component::Sfloat32, 2),
            Self::R32G32B32Sfloat => (Component::Sfloat32, 3),
            Self::R16G16Sfloat => (Component::Sfloat16, 2),
            Self::R16G16B16Sfloat => (Component::Sfloat16, 3),
            Self::R16G16B16A16Sfloat => (Component::Sfloat16, 4),
            Self::R16G16Snorm => (Component::Snorm16, 2),
            Self::R16G16B16Snorm => (Component::Snorm16, 3),
            Self::R16G16B16A16Snorm => (Component::Snorm16, 4),
        }
    }

    /// Bytes of a component.
    pub(super) fn component_size(self) -> u64 {
        if self.parts().0 == Component::Sfloat32 { 4 } else { 2 }
    }

    /// Bytes of an element.
    pub fn size(self) -> u64 {
        self.component_size() * self.parts().1 as u64
    }

    /// Widens an element to floats.
    pub(super) fn read(self, bytes: &[u8]) -> [f32; 3] {
        let (component, count) = self.parts();
        array::from_fn(|at| match component {
            _ if at >= count => 0.0,
            Component::Sfloat32 => f32::from_le_bytes(word(bytes, 4 * at)),
            Component::Sfloat16 => f16::from_le_bytes(word(bytes, 2 * at)).into(),
            Component::Snorm16 => snorm16(i16::from_le_bytes(word(bytes, 2 * at))),
        })
    }
}

impl RadiusFormat {
    /// Bytes of an element.
    pub(super) fn size(self) -> u64 {
        match self {
            Self::R32Sfloat => 4,
            Self::R16Sfloat => 2,
        }
    }

    /// Widens an element to a float.
    pub(super) fn read(self, bytes: &[u8]) -> f32 {
        match self {
            Self::R32Sfloat => f32::from_le_bytes(word(bytes, 0)),
            Self::R16Sfloat => f16::from_le_bytes(word(bytes, 0)).into(),
        }
    }
}

impl IndexType {
    /// Bytes of an element.
    pub(super) fn size(self) -> u64 {
        match self {
            Self::Uint8 => 1,
            Self::Uint16 => 2,
            Self::Uint32 => 4,
        }
    }
}

/// Vulkan, "Conversion from Normalized Fixed-Point to Floating-Point".
pub fn snorm16(word: i16) -> f32 {
    (f32::from(word) / 32767.0).max(-1.0)
}

/// Some bytes, from one on.
pub(super) fn word<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    array::from_fn(|byte| bytes[at + byte])
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::accel) fn floats(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    pub(in crate::accel) fn halves(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|x| f16::from_f32(*x).to_le_bytes()).collect()
    }

    pub(in crate::accel) fn shorts(values: &[u16]) -> Vec<u8> {
        values.iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    #[test]
    fn every_format_is_widened() {
        use VertexFormat as F;
        // 0.1 is no half: the nearest is 1638 / 16384.
        let tenth = 1638.0 / 16384.0;
        let snorm = shorts(&[32767, 0x8000, 0x8001, 16384]);
        let rows: [(F, Vec<u8>, [f32; 3]); 8] = [
            (F::R32G32Sfloat, floats(&[0.1, 2.0, 9.0]), [0.1, 2.0, 0.0]),
            (F::R32G32B32Sfloat, floats(&[0.1, 2.0, 3.0]), [0.1, 2.0, 3.0]),
            (F::R16G16Sfloat, halves(&[0.1, 2.0, 9.0]), [tenth, 2.0, 0.0]),
            (F::R16G16B16Sfloat, halves(&[0.1, 2.0, 3.0]), [tenth, 2.0, 3.0]),
            (F::R16G16B16A16Sfloat, halves(&[0.1, 2.0, 3.0, 9.0]), [tenth, 2.0, 3.0]),
            (F::R16G16Snorm, snorm.clone(), [1.0, -1.0, 0.0]),
            (F::R16G16B16Snorm, snorm.clone(), [1.0, -1.0, -1.0]),
            (F::R16G16B16A16Snorm, snorm, [1.0, -1.0, -1.0]),
        ];
        for (format, bytes, point) in rows {
            assert_eq!(format.read(&bytes), point, "{format:?}");
            assert_eq!(format.size(), format.component_size() * format.parts().1 as u64);
        }
        assert_eq!(RadiusFormat::R16Sfloat.read(&halves(&[0.1])), tenth);
        assert_eq!(snorm16(1), 1.0 / 32767.0);
    }
}
