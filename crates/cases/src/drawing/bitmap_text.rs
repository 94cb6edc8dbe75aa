//! Text in a picture, in the letters of a bitmap font.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use anyhit_scene::image::Rgba8;

const WEIGHT: FontWeight = FontWeight::Regular;
const HEIGHT: RasterHeight = RasterHeight::Size16;

/// The height of a line.
pub(super) const LINE_HEIGHT: u32 = HEIGHT.val() as u32;

/// The width of a text in pixels.
pub(super) fn width(text: &str) -> u32 {
    text.chars().count() as u32 * get_raster_width(WEIGHT, HEIGHT) as u32
}

/// Draws a text in an ink over what the picture shows, its upper left corner at a pixel. What is
/// outside the picture is cut off; letters beyond ASCII are question marks.
pub(super) fn draw(picture: &mut Rgba8, [left, top]: [u32; 2], text: &str, ink: [u8; 3]) {
    let [width, height] = picture.extent;
    let mut x = left;
    for letter in text.chars() {
        let Some(raster) = get_raster(letter, WEIGHT, HEIGHT).or_else(|| get_raster('?', WEIGHT, HEIGHT))
        else {
            continue;
        };
        for (y, row) in (top..height).zip(raster.rows()) {
            for (x, &cover) in (x..width).zip(row) {
                let at = 4 * (y as usize * width as usize + x as usize);
                for (under, ink) in picture.pixels[at..at + 3].iter_mut().zip(ink) {
                    let cover = u32::from(cover);
                    *under = ((u32::from(*under) * (255 - cover) + u32::from(ink) * cover) / 255) as u8;
                }
            }
        }
        x += raster.width() as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_drawn_inside_the_picture_only() {
        let mut picture = Rgba8 { extent: [20, 10], pixels: vec![255; 4 * 20 * 10] };
        draw(&mut picture, [2, 0], "H\u{e4}", [0, 0, 0]);
        let dark = |x: usize| (0..10).any(|y| picture.pixels[4 * (y * 20 + x)] < 128);
        assert!((2..9).any(dark), "an H has strokes");
        assert!((9..16).any(dark), "a letter beyond ASCII is a question mark");
        assert!(!(16..20).any(dark) && !(0..2).any(dark), "nothing beside the text");
        assert_eq!(width("H\u{e4}"), 14);
        draw(&mut picture, [100, 100], "far away", [0, 0, 0]);
    }
}
