//! Orientation of a picture whose file does not begin at the top left.

use crate::image::decoded::{Decoded, Numbers};

/// The way from stored rows to the picture: they may be its columns, and each side may be mirrored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Orientation {
    /// True if stored rows are columns of the picture.
    pub swaps: bool,
    /// True if the picture's left side is stored last.
    pub mirrors_x: bool,
    /// True if the picture's top is stored last.
    pub mirrors_y: bool,
}

impl Orientation {
    /// The orientation in Exif data (Exif 3.0, tag 0x0112): a TIFF header, then the entries of its
    /// first directory. Data that is broken has none.
    #[cfg(feature = "images")]
    pub(super) fn of_exif(data: &[u8]) -> Self {
        const ORIENTATION: u16 = 0x0112;
        const ENTRY: usize = 12;
        let is_little = data.starts_with(b"II*\0");
        let number = |at: usize| {
            let bytes: [u8; 2] = data.get(at..at.checked_add(2)?)?.try_into().ok()?;
            Some(if is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
        };
        let find = || {
            if !is_little && !data.starts_with(b"MM\0*") {
                return None;
            }
            let (low, high) = if is_little { (4, 6) } else { (6, 4) };
            let first = usize::from(number(high)?) << 16 | usize::from(number(low)?);
            let entries = (0..usize::from(number(first)?)).map(|at| first + 2 + ENTRY * at);
            entries.into_iter().find(|at| number(*at) == Some(ORIENTATION)).and_then(|at| number(at + 8))
        };
        let value = find().filter(|value| (1..=8).contains(value)).unwrap_or(1);
        Self {
            swaps: value >= 5,
            mirrors_x: matches!(value, 2 | 3 | 6 | 7),
            mirrors_y: matches!(value, 3 | 4 | 7 | 8),
        }
    }

    /// Width and height of the picture, given those that are stored.
    pub(super) fn extent(self, [width, height]: [u32; 2]) -> [u32; 2] {
        if self.swaps { [height, width] } else { [width, height] }
    }

    /// Turns what a file stores into the picture.
    pub(super) fn apply(self, stored: Decoded) -> Decoded {
        if self == Self::default() {
            return stored;
        }
        let Decoded { extent, channels, numbers } = stored;
        let numbers = match numbers {
            Numbers::Bytes(bytes) => Numbers::Bytes(self.turned(&bytes, channels, extent)),
            Numbers::BigEndian(bytes) => Numbers::BigEndian(self.turned(&bytes, 2 * channels, extent)),
            Numbers::Floats(floats) => Numbers::Floats(self.turned(&floats, channels, extent)),
        };
        Decoded { extent: self.extent(extent), channels, numbers }
    }

    fn turned<T: Copy>(self, numbers: &[T], texel: usize, stored: [u32; 2]) -> Vec<T> {
        let [width, height] = self.extent(stored).map(|side| side as usize);
        let mut turned = Vec::with_capacity(numbers.len());
        for y in 0..height {
            for x in 0..width {
                let column = if self.mirrors_x { width - 1 - x } else { x };
                let row = if self.mirrors_y { height - 1 - y } else { y };
                let (column, row) = if self.swaps { (row, column) } else { (column, row) };
                let at = texel * (row * stored[0] as usize + column);
                turned.extend_from_slice(&numbers[at..at + texel]);
            }
        }
        turned
    }
}

#[cfg(all(test, feature = "images"))]
mod tests {
    use super::*;

    /// Exif data with an entry before the orientation.
    fn exif(value: u8, is_little: bool) -> Vec<u8> {
        let words: [&[u16]; 3] = [&[2], &[0x010f, 2, 0, 1, 0, 0], &[0x0112, 3, 0, 1, value.into(), 0]];
        let words = words.concat().into_iter();
        if is_little {
            // The count of an entry is one number of 32 bits: its low half is first.
            let words = words.map(|word| word.to_le_bytes()).collect::<Vec<_>>().concat();
            let words = [&words[..6], &[1, 0, 0, 0], &words[10..18], &[1, 0, 0, 0], &words[22..]].concat();
            [b"II*\0\x08\0\0\0", &words[..]].concat()
        } else {
            let words = words.map(|word| word.to_be_bytes()).collect::<Vec<_>>().concat();
            [b"MM\0*\0\0\0\x08", &words[..]].concat()
        }
    }

    /// The meaning of each value in Exif 3.0: the side of the picture at the stored row 0, and that
    /// at the stored column 0.
    #[test]
    fn stored_rows_and_columns_are_sides_of_the_picture() {
        let sides = [
            ("top", "left"),
            ("top", "right"),
            ("bottom", "right"),
            ("bottom", "left"),
            ("left", "top"),
            ("right", "top"),
            ("right", "bottom"),
            ("left", "bottom"),
        ];
        for (value, (row, column)) in (1..).zip(sides) {
            for is_little in [false, true] {
                let orientation = Orientation::of_exif(&exif(value, is_little));
                // Two rows of three texels of two bytes.
                let numbers = Numbers::Bytes(vec![0, 0, 0, 1, 0, 2, 1, 0, 1, 1, 1, 2]);
                let stored = Decoded { extent: [3, 2], channels: 2, numbers };
                let Decoded { extent: [width, height], numbers: Numbers::Bytes(texels), .. } =
                    orientation.apply(stored)
                else {
                    panic!("other numbers")
                };
                let at = |x: u32, y: u32| &texels[2 * (y * width + x) as usize..][..2];
                assert_eq!([width, height], if value < 5 { [3, 2] } else { [2, 3] }, "{value}");
                for x in 0..width {
                    for y in 0..height {
                        let is_at = |side| match side {
                            "top" => y == 0,
                            "bottom" => y == height - 1,
                            "left" => x == 0,
                            _ => x == width - 1,
                        };
                        assert_eq!(at(x, y)[0] == 0, is_at(row), "{value}: {x} {y}");
                        assert_eq!(at(x, y)[1] == 0, is_at(column), "{value}: {x} {y}");
                    }
                }
            }
        }
    }

    #[test]
    fn broken_data_has_no_orientation() {
        let whole = exif(6, true);
        for data in
            [&whole[..whole.len() - 4], &exif(9, true), &exif(0, false), b"", b"II*\0\xff\xff\xff\xff"]
        {
            assert_eq!(Orientation::of_exif(data), Orientation::default());
        }
        for cut in 0..whole.len() - 4 {
            assert_eq!(Orientation::of_exif(&whole[..cut]), Orientation::default());
        }
    }
}
