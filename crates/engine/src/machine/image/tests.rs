//! Tests of images.

use super::*;
use crate::machine::format::Component;

#[test]
fn a_band_has_some_rows_of_the_whole() {
    let format = Format::new(Component::Uint8, 1);
    let band = Image::band(3, 5, 2..4, format, &[7]).unwrap();
    let position = |x, y| Position { at: [x, y, 0], ..Position::default() };
    assert_eq!((band.shape().extent, band.rows()), ([3, 5, 1], 2..4));
    // Two rows of three.
    let index = [(0, 1), (0, 2), (2, 3), (0, 4)].map(|(x, y)| band.index(&position(x, y)));
    assert_eq!(index, [None, Some(0), Some(5), None]);
    assert_eq!([band.contains(&position(0, 4)), band.contains(&position(0, 5))], [true, false]);
    band.store(5, 9);
    assert_eq!((band.row_bytes(3), band.bytes()), (vec![7, 7, 9], vec![7, 7, 7, 7, 7, 9]));
    assert_eq!(band.copied().row_bytes(3), [7, 7, 9]);
    assert!(Image::band(3, 5, 2..6, format, &[7]).is_err());
    assert_eq!(Image::zeroed(format, ImageShape::plane(3, 5)).unwrap().rows(), 0..5);
}

#[test]
fn an_image_is_filled_with_one_texel() {
    for (component, channels) in [(Component::Unorm8, 1), (Component::Uint16, 4), (Component::Float32, 4)] {
        let format = Format::new(component, channels);
        let texel: Vec<u8> = (1..=format.texel_size() as u8).collect();
        let image = Image::filled(format, ImageShape::plane(5, 3), &texel).unwrap();
        assert_eq!(image.bytes(), texel.repeat(15));
        assert!(Image::filled(format, ImageShape::plane(5, 3), &[0; 3]).is_err());
    }
}

#[test]
fn texels_of_every_size_keep_to_themselves() {
    for (component, channels) in [
        (Component::Unorm8, 1),
        (Component::Unorm8, 2),
        (Component::Unorm8, 4),
        (Component::Unorm16, 4),
        (Component::Float32, 4),
    ] {
        let format = Format::new(component, channels);
        let size = format.texel_size() as usize;
        let bytes: Vec<u8> = (0..6 * size).map(|at| at as u8).collect();
        let image = Image::new(format, ImageShape::plane(3, 2), &bytes).unwrap();
        let middle = image.index(&Position { at: [1, 1, 0], ..Position::default() }).unwrap();
        assert_eq!(middle, 4);
        let mut texel = [0; 16];
        texel[..size].copy_from_slice(&bytes[4 * size..5 * size]);
        assert_eq!(image.load(4), u128::from_le_bytes(texel));
        image.store(4, 0);
        let mut expected = bytes;
        expected[4 * size..5 * size].fill(0);
        assert_eq!(image.level_bytes(0), expected);
    }
}

#[test]
fn levels_layers_and_samples_have_their_places() {
    let format = Format::new(Component::Uint8, 1);
    let shape =
        ImageShape { dimension: Dimension::D2Array, extent: [5, 2, 1], layers: 2, levels: 3, samples: 1 };
    // 5 x 2, 2 x 1, 1 x 1, each twice.
    assert_eq!((shape.texels(), shape.max_levels()), (26, 3));
    let image = Image::zeroed(format, shape).unwrap();
    let index = |at, layer, level| image.index(&Position { at, layer, sample: 0, level });
    assert_eq!(index([4, 1, 0], 1, 0), Some(19));
    assert_eq!(index([1, 0, 0], 1, 1), Some(23));
    assert_eq!(index([0, 0, 0], 1, 2), Some(25));
    for outside in [index([5, 0, 0], 0, 0), index([-1, 0, 0], 0, 0), index([0, 0, 0], 2, 0)] {
        assert_eq!(outside, None);
    }
    assert_eq!(index([2, 0, 0], 0, 1), None);
    assert_eq!(index([0, 0, 0], 0, 3), None);
    let four = Image::zeroed(format, ImageShape { samples: 4, ..ImageShape::plane(2, 1) }).unwrap();
    let sample = |sample| four.index(&Position { at: [1, 0, 0], sample, ..Position::default() });
    assert_eq!((sample(3), sample(4)), (Some(7), None));
}

#[test]
fn an_update_gives_what_was_there() {
    let image =
        Image::new(Format::new(Component::Uint32, 1), ImageShape::plane(2, 1), &[1, 0, 0, 0, 2, 0, 0, 0]);
    let image = image.unwrap();
    assert_eq!(image.update(1, |old| Some(old.wrapping_sub(3))), 2);
    assert_eq!((image.load(0), image.load(1)), (1, 0xffff_ffff));
}

#[test]
fn shapes_that_do_not_fit_are_refused() {
    let plane = ImageShape::plane(4, 4);
    let refused = [
        ImageShape { extent: [4, 4, 2], ..plane },
        ImageShape { layers: 2, ..plane },
        ImageShape { levels: 4, ..plane },
        ImageShape { samples: 3, ..plane },
        ImageShape { samples: 4, levels: 2, ..plane },
        ImageShape { extent: [0, 1, 1], ..plane },
        ImageShape { dimension: Dimension::Cube, layers: 5, ..plane },
        ImageShape { dimension: Dimension::Cube, layers: 6, extent: [4, 2, 1], ..plane },
        ImageShape { dimension: Dimension::D1, ..plane },
    ];
    for shape in refused {
        assert_eq!(shape.check().unwrap_err().kind(), ErrorKind::InvalidImage, "{shape:?}");
    }
    assert!(ImageShape { levels: 3, ..plane }.check().is_ok());
    assert!(Image::new(Format::RGBA32F, plane, &[0; 255]).is_err());
}
