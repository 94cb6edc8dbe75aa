//! Generates mip levels from level 0 by a box filter.
//!
//! A texel of level n is the mean of the part of level 0 that it covers, by area: along an axis of
//! `s` texels, of which level n has `t`, texel i covers `i s / t` to `(i + 1) s / t`. sRGB colours
//! are averaged in linear light. Texels have the values that shaders read. Sums are computed in
//! binary64, over slices, rows and columns in this order, and each mean is rounded once to its
//! format.
//!
//! Where every level halves the one before and sums are exact, whatever their order, a level's sums
//! are those of the level before in pairs: level 0 is read once, not once for each level.

use crate::image::texel_numbers;
use anyhit_base::input::threads;
use anyhit_engine::machine::format::{Class, Component, Format};
use anyhit_engine::machine::image::ImageShape;
use anyhit_engine::math::array;

/// Checks that levels of a format can be generated.
///
/// # Errors
/// A message for integer formats, which have no means.
pub fn check(format: Format) -> Result<(), String> {
    match format.class() {
        Class::Float => Ok(()),
        _ => Err("levels of integer formats cannot be generated: provide the texels of every level".into()),
    }
}

/// Generates the texels of the levels 1 and up from those of level 0.
///
/// # Errors
/// As [`check`].
pub fn generate(format: Format, shape: &ImageShape, level0: &[u8]) -> Result<Vec<u8>, String> {
    check(format)?;
    let decoder = TexelDecoder::new(format);
    let halves = shape.extent.iter().all(|side| side.is_power_of_two());
    let exact_texels = if halves { decoder.exact_texels() } else { 0 };
    let size = decoder.size;
    let of_level = |level: u32| shape.level_texels(level) as usize * size;
    let mut texels = vec![0; (1..shape.levels).map(of_level).sum()];
    let mut rest = &mut texels[..];
    let mut sums: Vec<[f64; 4]> = Vec::new();
    for level in 1..shape.levels {
        let own;
        (own, rest) = rest.split_at_mut(of_level(level));
        let [from, extent] = [level - 1, level].map(|level| shape.level_extent(level));
        let covered: u64 = (0..3).map(|axis| u64::from(shape.extent[axis] / extent[axis].max(1))).product();
        if covered > exact_texels {
            means_by_area(&decoder, shape, level, level0, own);
            continue;
        }
        let texel = |at: usize| &level0[at * size..(at + 1) * size];
        sums = match level {
            1 => sums_of_pairs(shape.layers, from, extent, |at| decoder.numbers(texel(at))),
            _ => sums_of_pairs(shape.layers, from, extent, |at| sums[at]),
        };
        threads::fill(own, PART * size, &|begin, part| {
            for (texel, sum) in part.chunks_exact_mut(size).zip(&sums[begin / size..]) {
                write_texel(format, sum.map(|part| part / covered as f64), texel);
            }
        });
    }
    Ok(texels)
}

/// The texels that a thread reads at once, about.
const PART: usize = 1 << 16;

/// As [`texel_bytes`](crate::image::texel_bytes).
fn write_texel(format: Format, color: [f64; 4], bytes: &mut [u8]) {
    bytes.copy_from_slice(&format.encode_numbers(color).to_le_bytes()[..bytes.len()]);
}

/// For each texel of a level, the sum over those that it covers of the level before, each side of
/// which is as long or twice as long.
fn sums_of_pairs(
    layers: u32,
    from: [u32; 3],
    to: [u32; 3],
    numbers: impl Fn(usize) -> [f64; 4] + Sync,
) -> Vec<[f64; 4]> {
    let [from, to] = [from, to].map(|extent| extent.map(|side| side as usize));
    let [step_x, step_y, step_z]: [usize; 3] = array::from_fn(|axis| from[axis] / to[axis]);
    let mut sums = vec![[0.0; 4]; layers as usize * to[0] * to[1] * to[2]];
    threads::fill(&mut sums, rows_of_part(from[0] * step_y * step_z) * to[0], &|begin, part| {
        for (row, sums) in (begin / to[0]..).zip(part.chunks_exact_mut(to[0])) {
            let (layer, z, y) = (row / to[1] / to[2], row / to[1] % to[2], row % to[1]);
            for (k, j) in (0..step_z).flat_map(|k| (0..step_y).map(move |j| (k, j))) {
                let (z, y) = (z * step_z + k, y * step_y + j);
                let first = ((layer * from[2] + z) * from[1] + y) * from[0];
                for x in 0..from[0] {
                    let (sum, more): (&mut [f64; 4], _) = (&mut sums[x / step_x], numbers(first + x));
                    *sum = array::from_fn(|part| sum[part] + more[part]);
                }
            }
        }
    });
    sums
}

/// How many rows a thread makes at once, each of which reads so many texels.
fn rows_of_part(row_texels: usize) -> usize {
    (PART / row_texels.max(1)).max(1)
}

/// Makes the texels of a level, each from the part of level 0 that it covers.
fn means_by_area(decoder: &TexelDecoder, shape: &ImageShape, level: u32, level0: &[u8], texels: &mut [u8]) {
    let [width, height, depth] = shape.extent.map(|side| side as usize);
    let area: f64 = shape.extent.iter().map(|&side| f64::from(side)).product();
    let row_bytes = width * decoder.size;
    let extent = shape.level_extent(level);
    let [columns, rows, slices] = extent.map(|side| side as usize);
    let of_row = columns * decoder.size;
    let part = rows_of_part(width * height.div_ceil(rows) * depth.div_ceil(slices));
    threads::fill(texels, part * of_row, &|begin, part| {
        // Level 0 in numbers would take 32 bytes a texel: only one row of it is held.
        let mut row = Vec::with_capacity(width);
        let mut sums = Vec::new();
        for (at, texels) in (begin / of_row..).zip(part.chunks_exact_mut(of_row)) {
            let (layer, z, y) = (at / rows / slices, (at / rows % slices) as u32, (at % rows) as u32);
            sums.clear();
            sums.resize(columns, [0.0; 4]);
            for (k, weight_z) in covered(z, extent[2], shape.extent[2]) {
                for (j, weight_y) in covered(y, extent[1], shape.extent[1]) {
                    let begin = ((layer * depth + k) * height + j) * row_bytes;
                    let bytes = level0[begin..begin + row_bytes].chunks_exact(decoder.size);
                    row.clear();
                    row.extend(bytes.map(|texel| decoder.numbers(texel)));
                    for (x, sum) in (0..).zip(&mut sums) {
                        for (i, weight_x) in covered(x, extent[0], shape.extent[0]) {
                            let weight = weight_x * weight_y * weight_z;
                            let texel: [f64; 4] = row[i];
                            *sum = array::from_fn(|part| sum[part] + weight * texel[part]);
                        }
                    }
                }
            }
            for (texel, sum) in texels.chunks_exact_mut(decoder.size).zip(&sums) {
                write_texel(decoder.format, sum.map(|part| part / area), texel);
            }
        }
    });
}

/// Decodes texels, each some ten times.
struct TexelDecoder {
    format: Format,
    /// Bytes of a texel.
    size: usize,
    /// For channels of a byte each, the number that each byte stands for: no computation is needed
    /// for these, the most common formats.
    bytes: Vec<[f64; 4]>,
}

impl TexelDecoder {
    fn new(format: Format) -> Self {
        let size = format.texel_size() as usize;
        let is_bytes = matches!(format.component, Component::Unorm8 | Component::Snorm8);
        let texel = |byte: u8| texel_numbers(format, &[byte; 4][..size]);
        let bytes = if is_bytes { (0..=u8::MAX).map(texel).collect() } else { Vec::new() };
        Self { format, size, bytes }
    }

    /// How many texels can be added in binary64 without rounding, in any order. Channels of a byte
    /// are multiples of the last place of the smallest one, in binary32, and at most 1: 1/127 and
    /// 1/255 are multiples of 2^-30 and 2^-31, and 1/(255 x 12.92) of 2^-35.
    fn exact_texels(&self) -> u64 {
        match self.format.component {
            _ if self.format.srgb => 1 << (53 - 35),
            Component::Unorm8 => 1 << (53 - 31),
            Component::Snorm8 => 1 << (53 - 30),
            _ => 0,
        }
    }

    /// As [`texel_numbers`].
    fn numbers(&self, texel: &[u8]) -> [f64; 4] {
        if self.bytes.is_empty() {
            return texel_numbers(self.format, texel);
        }
        // Channels that are missing have the same number in all of them.
        array::from_fn(|part| self.bytes[usize::from(texel.get(part).copied().unwrap_or(0))][part])
    }
}

/// Along an axis, the texels of `from` that texel `at` of `to` covers, and the weight of each: the
/// covered part in units of 1 / `to`. The sum of the weights is `from`.
fn covered(at: u32, to: u32, from: u32) -> impl Iterator<Item = (usize, f64)> {
    let (at, to, from) = (u64::from(at), u64::from(to), u64::from(from));
    let (begin, end) = (at * from, (at + 1) * from);
    (begin / to..end.div_ceil(to)).map(move |texel| {
        let part = end.min((texel + 1) * to) - begin.max(texel * to);
        (texel as usize, part as f64)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::machine::image::Dimension;
    use anyhit_engine::math::random::Random;

    fn line(texels: &[f32], levels: u32) -> Vec<f32> {
        let extent = [texels.len() as u32, 1, 1];
        let shape = ImageShape { dimension: Dimension::D1, extent, layers: 1, levels, samples: 1 };
        let bytes: Vec<u8> = texels.iter().flat_map(|x| x.to_le_bytes()).collect();
        let more = generate(Format::new(Component::Float32, 1), &shape, &bytes).unwrap();
        more.chunks(4).map(|x| f32::from_le_bytes(x.try_into().unwrap())).collect()
    }

    #[test]
    fn texels_are_means_by_area() {
        assert_eq!(line(&[1.0, 3.0, 5.0, 11.0], 3), [2.0, 8.0, 5.0]);
        // Five texels become two: each covers two and a half.
        assert_eq!(line(&[10.0, 20.0, 30.0, 40.0, 50.0], 3), [18.0, 42.0, 30.0]);
    }

    #[test]
    fn planes_and_layers() {
        let format = Format::new(Component::Unorm8, 1);
        let shape =
            ImageShape { dimension: Dimension::D2Array, layers: 2, levels: 2, ..ImageShape::plane(2, 2) };
        // (0 + 1 + 2 + 4) / 4 = 1.75, (1 + 1 + 1 + 6) / 4 = 2.25.
        assert_eq!(generate(format, &shape, &[0, 1, 2, 4, 1, 1, 1, 6]), Ok(vec![2, 2]));
    }

    #[test]
    fn srgb_is_averaged_in_linear_light() {
        let format = Format { channels: 4, ..Format::RGBA8_SRGB };
        let shape = ImageShape { levels: 2, ..ImageShape::plane(2, 1) };
        // Black and white: linear 0.5 is code 188 (187.516), alpha 127.5 goes to 128.
        let mean = generate(format, &shape, &[0, 0, 0, 0, 255, 255, 255, 255]);
        assert_eq!(mean, Ok(vec![188, 188, 188, 128]));
    }

    /// The numbers of all bytes are multiples of what `exact_texels` says, which sums up to 2^53 of
    /// stay exact.
    #[test]
    fn sums_of_bytes_are_exact() {
        let formats = [
            Format { channels: 4, ..Format::RGBA8_SRGB },
            Format::new(Component::Unorm8, 1),
            Format::new(Component::Snorm8, 1),
        ];
        for format in formats {
            let decoder = TexelDecoder::new(format);
            let unit = decoder.exact_texels() as f64 / 2f64.powi(53);
            for byte in 0..=u8::MAX {
                for number in decoder.numbers(&[byte; 4][..decoder.size]) {
                    assert!((number / unit).fract() == 0.0 && number.abs() <= 1.0, "{format:?}: {byte}");
                }
            }
        }
    }

    #[test]
    fn halved_levels_are_the_means_by_area() {
        let shapes = [
            ImageShape { levels: 6, ..ImageShape::plane(32, 16) },
            ImageShape { levels: 5, ..ImageShape::plane(2, 16) },
            ImageShape { dimension: Dimension::D2Array, layers: 3, levels: 4, ..ImageShape::plane(8, 8) },
            ImageShape { dimension: Dimension::D3, extent: [8, 4, 16], layers: 1, levels: 5, samples: 1 },
        ];
        let mut random = 7u32;
        for (shape, format) in shapes.iter().flat_map(|shape| {
            [Format::RGBA8_SRGB, Format::new(Component::Snorm8, 2)].map(|format| (shape, format))
        }) {
            let size = shape.level_texels(0) as usize * format.texel_size() as usize;
            let level0: Vec<u8> = (0..size)
                .map(|_| {
                    random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (random >> 24) as u8
                })
                .collect();
            let mut expected = Vec::new();
            for level in 1..shape.levels {
                let begin = expected.len();
                expected.resize(begin + shape.level_texels(level) as usize * format.texel_size() as usize, 0);
                means_by_area(&TexelDecoder::new(format), shape, level, &level0, &mut expected[begin..]);
            }
            assert_eq!(generate(format, shape, &level0), Ok(expected), "{shape:?} {format:?}");
        }
    }

    #[test]
    fn levels_do_not_depend_on_the_number_of_threads() {
        let float = Format::new(Component::Float32, 4);
        let shapes = [
            (ImageShape { levels: 10, ..ImageShape::plane(512, 1024) }, Format::RGBA8_SRGB),
            (ImageShape { levels: 9, ..ImageShape::plane(601, 333) }, float),
            (ImageShape { dimension: Dimension::D2Array, layers: 3, ..ImageShape::plane(300, 257) }, float),
        ];
        for (shape, format) in shapes {
            let shape = ImageShape { levels: shape.levels.max(4), ..shape };
            let texels = shape.level_texels(0) as usize * format.texel_size() as usize / 4;
            let mut random = Random::new(3);
            let level0: Vec<u8> = (0..texels).flat_map(|_| (random.unit() + 1e-3).to_le_bytes()).collect();
            let on_threads = |count: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
                pool.install(|| generate(format, &shape, &level0)).unwrap()
            };
            let one = on_threads(1);
            assert!(one.iter().any(|&byte| byte != 0));
            for threads in [2, 3] {
                assert!(on_threads(threads) == one, "{shape:?}: {threads} threads");
            }
        }
    }

    #[test]
    fn channels_of_bytes_are_decoded_as_all_others() {
        for channels in [1, 2, 4] {
            for component in [Component::Unorm8, Component::Snorm8] {
                for srgb in [false, component == Component::Unorm8 && channels == 4] {
                    let format = Format { component, channels, srgb };
                    let decoder = TexelDecoder::new(format);
                    for byte in 0..=u8::MAX {
                        let texel = [byte, byte ^ 0xff, byte.wrapping_add(77), 1];
                        let texel = &texel[..usize::from(channels)];
                        assert_eq!(
                            decoder.numbers(texel),
                            texel_numbers(format, texel),
                            "{format:?} {texel:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn integers_have_no_mean() {
        let format = Format::new(Component::Uint8, 1);
        assert!(generate(format, &ImageShape { levels: 2, ..ImageShape::plane(2, 1) }, &[0, 1]).is_err());
    }
}
