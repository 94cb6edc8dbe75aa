//! Radiance files, `.hdr`: three mantissas of eight bits and one exponent a texel.
//!
//! The format is that of the Radiance reference manual, section 4, "Picture file format": header
//! lines up to an empty one, the resolution, and rows that are either texels, some of them repeat
//! counts, or the four components one after the other, each in runs. The numbers are those of the
//! texels: `EXPOSURE`, `COLORCORR` and `GAMMA` of the header are not applied.

use crate::image::decoded::{Decoded, Numbers};
use crate::image::invalid;
use crate::image::orientation::Orientation;
use anyhit_base::error::Result;

/// What a file says of itself, and its rows.
pub(super) struct Radiance<'a> {
    /// The length and the number of stored rows.
    stored: [u32; 2],
    orientation: Orientation,
    rows: &'a [u8],
}

/// The widths of rows that may be run-length encoded.
const RUN_WIDTHS: std::ops::RangeInclusive<usize> = 8..=0x7fff;

impl<'a> Radiance<'a> {
    /// Whether a file begins as Radiance files do.
    pub(super) fn is(bytes: &[u8]) -> bool {
        bytes.starts_with(b"#?RADIANCE") || bytes.starts_with(b"#?RGBE")
    }

    /// Reads the header.
    ///
    /// # Errors
    /// `InvalidImage` where it is broken, and for the colours of another format than RGBE.
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self> {
        let mut rest = bytes;
        loop {
            let line = line(&mut rest)?;
            if line.is_empty() {
                break;
            }
            if let Some(format) = value_of(line, b"FORMAT")
                && format != b"32-bit_rle_rgbe"
            {
                let format = String::from_utf8_lossy(format);
                return Err(invalid(format!(
                    "unsupported format `{format}` of an HDR file: expected `32-bit_rle_rgbe`"
                )));
            }
        }
        let resolution = line(&mut rest)?;
        let (stored, orientation) = resolution_of(resolution).ok_or_else(|| {
            let text = String::from_utf8_lossy(resolution);
            invalid(format!("invalid resolution `{text}` of an HDR file: expected `-Y height +X width`"))
        })?;
        Ok(Self { stored, orientation, rows: rest })
    }

    /// Width and height of the picture.
    pub(super) fn extent(&self) -> [u32; 2] {
        self.orientation.extent(self.stored)
    }

    /// The picture, three numbers for every texel.
    ///
    /// # Errors
    /// As [`Radiance::numbers`].
    pub(super) fn picture(&self) -> Result<Decoded> {
        let numbers = Numbers::Floats(self.numbers()?);
        Ok(self.orientation.apply(Decoded { extent: self.stored, channels: 3, numbers }))
    }

    /// Three numbers for every texel in the order of the file.
    ///
    /// # Errors
    /// `InvalidImage` where rows end early or runs are longer than their row.
    fn numbers(&self) -> Result<Vec<f32>> {
        let [width, height] = self.stored.map(|side| side as usize);
        let mut numbers = Vec::with_capacity(3 * width * height);
        let mut texels = vec![[0; 4]; width];
        let mut rest = self.rows;
        for _ in 0..height {
            match *rest {
                [2, 2, high, low, ref runs @ ..]
                    if RUN_WIDTHS.contains(&width) && u16::from_be_bytes([high, low]) as usize == width =>
                {
                    rest = runs;
                    (0..4).try_for_each(|component| component_runs(&mut rest, &mut texels, component))?;
                }
                _ => repeated_texels(&mut rest, &mut texels)?,
            }
            numbers.extend(texels.iter().flat_map(|texel| colour(*texel)));
        }
        Ok(numbers)
    }
}

/// The value of a variable that a header line sets.
fn value_of<'a>(line: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    let at = line.iter().position(|byte| *byte == b'=')?;
    (line[..at].trim_ascii() == name).then(|| line[at + 1..].trim_ascii())
}

/// The length and number of rows, and their orientation: first the axis on which rows follow each
/// other, then that of a row's texels. `+X` is from left to right, `-Y` from top to bottom.
fn resolution_of(line: &[u8]) -> Option<([u32; 2], Orientation)> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let mut next = || {
        let axis = words.next()?;
        let side: u32 = std::str::from_utf8(words.next()?).ok()?.parse().ok()?;
        (side > 0).then_some((axis, side))
    };
    let ((axis, rows), (other, length)) = (next()?, next()?);
    let (swaps, [x, y]) = match (axis, other) {
        ([_, b'Y'], [_, b'X']) => (false, [other, axis]),
        ([_, b'X'], [_, b'Y']) => (true, [axis, other]),
        _ => return None,
    };
    let is_signed = |axis: &[u8]| matches!(axis[0], b'+' | b'-');
    let orientation = Orientation { swaps, mirrors_x: x[0] == b'-', mirrors_y: y[0] == b'+' };
    (is_signed(x) && is_signed(y) && words.next().is_none()).then_some(([length, rows], orientation))
}

/// The next line without its end, a line feed with or without a carriage return.
fn line<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8]> {
    let end = rest.iter().position(|byte| *byte == b'\n');
    let end = end.ok_or_else(|| invalid("the HDR file ends within its header"))?;
    let line = &rest[..end];
    *rest = &rest[end + 1..];
    Ok(line.strip_suffix(b"\r").unwrap_or(line))
}

fn next<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N]> {
    let (head, tail) = rest.split_first_chunk().ok_or_else(|| invalid("the HDR file ends within a row"))?;
    *rest = tail;
    Ok(*head)
}

/// One component of a row: counts above 128 repeat the byte behind them, others say how many bytes
/// follow.
fn component_runs(rest: &mut &[u8], texels: &mut [[u8; 4]], component: usize) -> Result<()> {
    let mut at = 0;
    while at < texels.len() {
        let [count] = next(rest)?;
        let repeats = count > 128;
        let count = usize::from(if repeats { count - 128 } else { count });
        if count == 0 || count > texels.len() - at {
            return Err(invalid("a run of the HDR file exceeds its row"));
        }
        let repeated = if repeats { next::<1>(rest)?[0] } else { 0 };
        for texel in &mut texels[at..at + count] {
            texel[component] = if repeats { repeated } else { next::<1>(rest)?[0] };
        }
        at += count;
    }
    Ok(())
}

/// A row of texels: one whose mantissas are all 1 repeats the texel before it, and the counts of
/// several in a row are the digits of one number, the lowest first.
fn repeated_texels(rest: &mut &[u8], texels: &mut [[u8; 4]]) -> Result<()> {
    let (mut at, mut shift) = (0, 0);
    while at < texels.len() {
        let texel: [u8; 4] = next(rest)?;
        if texel[..3] != [1; 3] {
            texels[at] = texel;
            (at, shift) = (at + 1, 0);
            continue;
        }
        let count = usize::from(texel[3]) << shift;
        if at == 0 || count > texels.len() - at || shift > 16 {
            return Err(invalid("a run of the HDR file exceeds its row"));
        }
        let before = texels[at - 1];
        texels[at..at + count].fill(before);
        (at, shift) = (at + count, shift + 8);
    }
    Ok(())
}

/// Three mantissas over 256, times 2 to the power of the exponent less 128.
fn colour([red, green, blue, exponent]: [u8; 4]) -> [f32; 3] {
    let scale = if exponent == 0 { 0.0 } else { f32::exp2(f32::from(exponent) - (128.0 + 8.0)) };
    [red, green, blue].map(|mantissa| f32::from(mantissa) * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(resolution: &str, rows: &[u8]) -> Vec<u8> {
        let head = format!("#?RADIANCE\n# by hand\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1\n\n{resolution}\n");
        [head.as_bytes(), rows].concat()
    }

    fn numbers(resolution: &str, rows: &[u8]) -> Result<Vec<f32>> {
        Radiance::new(&file(resolution, rows))?.numbers()
    }

    #[test]
    fn plain_texels_and_repeated_ones() {
        // 128 / 256 * 2^(129 - 128) = 1
        let texel = [128, 64, 0, 129];
        assert_eq!(numbers("-Y 1 +X 1", &texel).unwrap(), [1.0, 0.5, 0.0]);
        assert_eq!(numbers("-Y 1 +X 1", &[9, 9, 9, 0]).unwrap(), [0.0; 3]);
        let row = [texel, [1, 1, 1, 2], [0, 0, 128, 128]].concat();
        let wanted = [1.0, 0.5, 0.0, 1.0, 0.5, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.5];
        assert_eq!(numbers("-Y 1 +X 4", &row).unwrap(), wanted);
        // 1 + 1 * 256 repetitions.
        let row = [texel, [1, 1, 1, 1], [1, 1, 1, 1]].concat();
        assert_eq!(numbers("-Y 1 +X 258", &row).unwrap(), [1.0, 0.5, 0.0].repeat(258));
    }

    #[test]
    fn components_in_runs() {
        let row = [2, 2, 0, 8, 136, 128, 8, 0, 64, 0, 64, 0, 64, 0, 64, 136, 0, 136, 129];
        let wanted = [1.0, 0.0, 0.0, 1.0, 0.5, 0.0].repeat(4);
        assert_eq!(numbers("-Y 1 +X 8", &row).unwrap(), wanted);
        // Two rows, the second of plain texels.
        let plain = [128, 0, 0, 129].repeat(8);
        let both = numbers("-Y 2 +X 8", &[&row[..], &plain].concat()).unwrap();
        assert_eq!(both, [wanted, [1.0, 0.0, 0.0].repeat(8)].concat());
    }

    #[test]
    fn lines_end_in_two_ways_and_have_spaces() {
        let head = "#?RADIANCE\r\nFORMAT = 32-bit_rle_rgbe \r\n\r\n-Y 1 +X 1\r\n";
        let bytes = [head.as_bytes(), &[128, 64, 0, 129]].concat();
        let file = Radiance::new(&bytes).unwrap();
        assert_eq!((file.extent(), file.numbers().unwrap()), ([1, 1], vec![1.0, 0.5, 0.0]));
    }

    /// The eight orientations of the manual: rows of three texels, which the file stores in the
    /// order 0 1 2, 3 4 5.
    #[test]
    fn rows_and_columns_go_in_all_directions() {
        let texels: Vec<u8> = (0..6).flat_map(|texel| [texel << 5, 0, 0, 128 + 8]).collect();
        for (resolution, extent, wanted) in [
            ("-Y 2 +X 3", [3, 2], [0, 1, 2, 3, 4, 5]),
            ("-Y 2 -X 3", [3, 2], [2, 1, 0, 5, 4, 3]),
            ("+Y 2 +X 3", [3, 2], [3, 4, 5, 0, 1, 2]),
            ("+Y 2 -X 3", [3, 2], [5, 4, 3, 2, 1, 0]),
            // Stored rows are columns: 0 1 2 is the left one, from the top.
            ("+X 2 -Y 3", [2, 3], [0, 3, 1, 4, 2, 5]),
            ("-X 2 -Y 3", [2, 3], [3, 0, 4, 1, 5, 2]),
            ("+X 2 +Y 3", [2, 3], [2, 5, 1, 4, 0, 3]),
            ("-X 2 +Y 3", [2, 3], [5, 2, 4, 1, 3, 0]),
        ] {
            let bytes = file(resolution, &texels);
            let picture = Radiance::new(&bytes).unwrap().picture().unwrap();
            let Numbers::Floats(numbers) = picture.numbers else { panic!("{resolution}") };
            let red: Vec<u32> = numbers.iter().step_by(3).map(|red| *red as u32 >> 5).collect();
            assert_eq!((picture.extent, &red[..]), (extent, &wanted[..]), "{resolution}");
        }
    }

    #[test]
    fn broken_files_are_told() {
        let message = |bytes: &[u8]| {
            let error = Radiance::new(bytes).and_then(|file| file.numbers()).unwrap_err();
            error.to_string()
        };
        let rows = |rows: &[u8], resolution| message(&file(resolution, rows));
        assert!(message(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n").contains("ends within its header"));
        assert!(message(b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n").contains("`32-bit_rle_xyze`"));
        for resolution in
            ["-Y 0 +X 1", "-Y 1 +X", "-Y 1 +X 99999999999", "-Y 1 -Y 1", "*Y 1 +X 1", "-Y 1 +X 1 1"]
        {
            assert!(rows(&[], resolution).contains(resolution), "{resolution}");
        }
        assert!(rows(&[1, 2, 3], "-Y 1 +X 1").contains("ends within a row"));
        assert!(rows(&[1, 1, 1, 1], "-Y 1 +X 1").contains("exceeds its row"));
        assert!(rows(&[2, 2, 0, 8, 137, 1], "-Y 1 +X 8").contains("exceeds its row"));
        assert!(rows(&[2, 2, 0, 8, 0, 1], "-Y 1 +X 8").contains("exceeds its row"));
        assert!(rows(&[2, 2, 0, 8, 136], "-Y 1 +X 8").contains("ends within a row"));
    }
}
