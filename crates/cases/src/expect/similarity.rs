//! How alike two pictures look, from 0 to 1: structure, colour and opacity.
//!
//! The structure of the luma is compared by the structural similarity of Wang, Bovik, Sheikh and
//! Simoncelli ("Image Quality Assessment: From Error Visibility to Structural Similarity", 2004)
//! over windows of 8 x 8 texels side by side; colours and alpha by the distance of each texel. The
//! least of the three counts, and less where both texels are transparent. It is the hybrid measure
//! of the crate `image-compare`, which a test compares it with.

use anyhit_scene::image::Rgba8;

/// The side of a window.
const WINDOW_SIDE: usize = 8;
/// The constants of structural similarity for numbers up to 255, which keep flat windows apart from
/// a division by zero.
const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);

/// A texel as luma, two differences of colour, and alpha, as ITU-T T.871 (JFIF) defines them.
fn yuva(texel: [u8; 4]) -> [u8; 4] {
    let [r, g, b, _] = texel.map(f32::from);
    let y = 0.299 * r + 0.587 * g + 0.114 * b;
    let u = 128.0 - 0.168_736 * r - 0.331_264 * g + 0.5 * b;
    let v = 128.0 + 0.5 * r - 0.418_688 * g - 0.081_312 * b;
    // The conversion saturates.
    [y as u8, u as u8, v as u8, texel[3]]
}

/// How alike two pictures of one size look; equal ones are at 1.
pub(super) fn similarity(expected: &Rgba8, found: &Rgba8) -> f64 {
    let [width, height] = expected.extent.map(|side| side as usize);
    let texels = |picture: &Rgba8| -> Vec<[u8; 4]> {
        picture.pixels.as_chunks::<4>().0.iter().map(|texel| yuva(*texel)).collect()
    };
    let (expected, found) = (texels(expected), texels(found));
    let (mut sum, mut count) = (0.0, 0_usize);
    for top in (0..height).step_by(WINDOW_SIDE) {
        for left in (0..width).step_by(WINDOW_SIDE) {
            let rows = top..height.min(top + WINDOW_SIDE);
            let columns = left..width.min(left + WINDOW_SIDE);
            let window: Vec<([u8; 4], [u8; 4])> = rows
                .flat_map(|y| columns.clone().map(move |x| y * width + x))
                .map(|at| (expected[at], found[at]))
                .collect();
            let structure = (structural_similarity(&window) as f32).clamp(0.0, 1.0);
            sum += window.iter().map(|(a, b)| f64::from(texel_similarity(structure, *a, *b))).sum::<f64>();
            count += window.len();
        }
    }
    if count == 0 { 1.0 } else { sum / count as f64 }
}

/// The structural similarity of the luma in one window.
fn structural_similarity(window: &[([u8; 4], [u8; 4])]) -> f64 {
    let area = window.len() as f64;
    let (mut mean_a, mut mean_b) = (0.0, 0.0);
    for (a, b) in window {
        mean_a += f64::from(a[0]) / area;
        mean_b += f64::from(b[0]) / area;
    }
    // Sums of squares, not their means: the crate's measure, which scenes have numbers of.
    let (mut variance_a, mut variance_b, mut covariance) = (0.0, 0.0, 0.0);
    for (a, b) in window {
        let (a, b) = (f64::from(a[0]) - mean_a, f64::from(b[0]) - mean_b);
        variance_a += a * a;
        variance_b += b * b;
        covariance += a * b;
    }
    (2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2)
        / ((mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2))
}

fn texel_similarity(structure: f32, a: [u8; 4], b: [u8; 4]) -> f32 {
    let channel = |at: usize| 1.0 - f32::from(a[at].abs_diff(b[at])) / 255.0;
    let colour = channel(1).hypot(channel(2)).min(1.0);
    let least = structure.min(colour).min(channel(3));
    let opacity = (f32::from(a[3]) + f32::from(b[3])) / 510.0;
    // The less is seen of both, the less it counts that they differ.
    if opacity > 0.0 { (least / opacity).min(1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(extent: [u32; 2], pixels: Vec<u8>) -> Rgba8 {
        Rgba8 { extent, pixels }
    }

    #[test]
    fn similarity_is_the_least_of_luma_s_structure_and_colour() {
        let two = |pixels: [[u8; 4]; 2]| picture([2, 1], pixels.concat());
        let (black, white) = ([0, 0, 0, 255], [255, 255, 255, 255]);
        let one = two([black, white]);
        assert_eq!(similarity(&one, &one), 1.0);
        // Both means are 255/2, the deviations opposite: SSIM is below 0, and a pixel counts from
        // 0.
        assert_eq!(similarity(&one, &two([white, black])), 0.0);
        // Flat grey: without deviations SSIM is (2 a b + c) / (a^2 + b^2 + c) with c = (255 /
        // 100)^2, and neither colour nor alpha differ.
        let grey = |level| two([[level, level, level, 255]; 2]);
        let (a, b, c) = (100.0, 50.0, 2.55 * 2.55);
        let expected = (2.0 * a * b + c) / (a * a + b * b + c);
        assert!((similarity(&grey(100), &grey(50)) - expected).abs() < 1e-6);
    }

    #[test]
    fn it_is_the_measure_of_image_compare() {
        // Numbers of a linear congruential generator; pictures that are like each other, and not.
        let mut state = 1_u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        for extent in [[1, 1], [8, 8], [9, 7], [33, 17]] {
            for spread in [0, 4, 60, 255] {
                let size = 4 * extent[0] as usize * extent[1] as usize;
                let one: Vec<u8> = (0..size).map(|_| random()).collect();
                let near = |byte: &u8| byte.wrapping_add((u16::from(random()) * spread / 255) as u8);
                let other: Vec<u8> = one.iter().map(near).collect();
                let image = |bytes: &Vec<u8>| {
                    image::RgbaImage::from_raw(extent[0], extent[1], bytes.clone()).expect("its size")
                };
                let judged = image_compare::rgba_hybrid_compare(&image(&one), &image(&other));
                let judged = judged.expect("pictures of one size").score;
                let found = similarity(&picture(extent, one), &picture(extent, other));
                assert!((found - judged).abs() < 1e-6, "{extent:?}, {spread}: {found} and {judged}");
            }
        }
    }
}
