//! Hand-derived values of the filters, for cases that `shaders/pass/images` does not cover.

use std::sync::Arc;

use crate::machine::format::{Component, Format};
use crate::machine::image::{Dimension, Image, ImageShape};
use crate::machine::sampler::{AddressMode, BorderColor, CompareOp, Filter, ReductionMode, Sampler};
use crate::ops::image::filter::{Lod, Lookup};

const R32F: Format = Format::new(Component::Float32, 1);

fn floats(shape: ImageShape, texels: &[f32]) -> Arc<Image> {
    let bytes: Vec<u8> = texels.iter().flat_map(|x| x.to_le_bytes()).collect();
    Image::new(R32F, shape, &bytes).unwrap()
}

fn lookup<'a>(image: &'a Image, sampler: &'a Sampler, at: [f32; 3]) -> Lookup<'a> {
    Lookup { at, ..Lookup::new(image, sampler) }
}

fn color(lookup: &Lookup<'_>, lod: f32) -> [f32; 4] {
    lookup.sample(Lod::Explicit(lod), 0.0, 0.0).map(|bits| f32::from_bits(bits as u32))
}

fn red(image: &Image, sampler: &Sampler, at: [f32; 3]) -> f32 {
    color(&lookup(image, sampler, at), 0.0)[0]
}

fn clamped() -> Sampler {
    Sampler { address_mode: [AddressMode::ClampToEdge; 3], ..Sampler::default() }
}

#[test]
fn nan_and_infinite_coordinates_have_a_value() {
    let plane = floats(ImageShape::plane(2, 1), &[4.0, 8.0]);
    let modes = [
        (AddressMode::ClampToEdge, [4.0, 8.0, 4.0]),
        // The greatest integer is odd, the least even.
        (AddressMode::Repeat, [4.0, 8.0, 4.0]),
        (AddressMode::ClampToBorder, [4.0, 0.0, 0.0]),
    ];
    for (mode, expected) in modes {
        let sampler = Sampler { address_mode: [mode; 3], mag_filter: Filter::Nearest, ..Sampler::default() };
        let found =
            [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].map(|s| red(&plane, &sampler, [s, 0.5, 0.0]));
        assert_eq!(found, expected, "{mode:?}");
    }
    let cube =
        floats(ImageShape { dimension: Dimension::Cube, layers: 6, ..ImageShape::plane(1, 1) }, &[1.0; 6]);
    for at in [[0.0; 3], [f32::NAN; 3], [f32::INFINITY; 3], [f32::MAX, f32::MIN, 0.0]] {
        assert_eq!(red(&cube, &Sampler::default(), at), 1.0, "{at:?}");
    }
}

#[test]
fn an_infinity_beside_a_texels_centre_does_no_harm() {
    let plane = floats(ImageShape::plane(2, 1), &[4.0, f32::INFINITY]);
    assert_eq!(red(&plane, &clamped(), [0.25, 0.5, 0.0]), 4.0);
    assert_eq!(red(&plane, &clamped(), [0.3125, 0.5, 0.0]), f32::INFINITY);
}

#[test]
fn borders_take_the_components_that_the_format_has() {
    let sampler = Sampler { address_mode: [AddressMode::ClampToBorder; 3], ..Sampler::default() };
    let outside = |format: Format, border_color: BorderColor| {
        let image = Image::zeroed(format, ImageShape::plane(1, 1)).unwrap();
        let sampler = Sampler { border_color, ..sampler };
        color(&lookup(&image, &sampler, [-3.0, 0.5, 0.0]), 0.0)
    };
    let two = Format::new(Component::Unorm8, 2);
    assert_eq!(outside(two, BorderColor::OpaqueWhite), [1.0, 1.0, 0.0, 1.0]);
    assert_eq!(outside(two, BorderColor::TransparentBlack), [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(outside(Format::RGBA32F, BorderColor::TransparentBlack), [0.0; 4]);
    assert_eq!(outside(Format::RGBA32F, BorderColor::OpaqueBlack), [0.0, 0.0, 0.0, 1.0]);
    // Half a texel outside: a quarter of the way, u - 0.5 = -0.25, the border weighs 0.25.
    let image = floats(ImageShape::plane(2, 1), &[4.0, 8.0]);
    let white = Sampler { border_color: BorderColor::OpaqueWhite, ..sampler };
    let half = Sampler {
        address_mode: [AddressMode::ClampToBorder, AddressMode::Repeat, AddressMode::Repeat],
        ..white
    };
    assert_eq!(red(&image, &half, [0.125, 0.5, 0.0]), 0.25 * 1.0 + 0.75 * 4.0);
    // Integer formats give integers: 1 is 1, not 1.0.
    let integers = Image::zeroed(Format::new(Component::Uint8, 4), ImageShape::plane(1, 1)).unwrap();
    let texel = lookup(&integers, &white, [9.0, 0.5, 0.0]).sample(Lod::Explicit(0.0), 0.0, 0.0);
    assert_eq!(texel, [1; 4]);
}

#[test]
fn reductions_leave_out_texels_without_weight() {
    let plane = floats(ImageShape::plane(4, 1), &[1.0, 5.0, 3.0, 9.0]);
    let reduced = |reduction_mode, s| {
        let sampler = Sampler { reduction_mode, ..clamped() };
        red(&plane, &sampler, [s, 0.5, 0.0])
    };
    // u = 2: texels 1 and 2; u = 2.5: texel 2 alone.
    assert_eq!(reduced(ReductionMode::Min, 0.5), 3.0);
    assert_eq!(reduced(ReductionMode::Max, 0.5), 5.0);
    assert_eq!(reduced(ReductionMode::Min, 0.625), 3.0);
    assert_eq!(reduced(ReductionMode::Max, 0.625), 3.0);
}

#[test]
fn unnormalized_coordinates_count_texels() {
    let plane = floats(ImageShape::plane(4, 1), &[1.0, 5.0, 3.0, 9.0]);
    let sampler = Sampler { unnormalized_coordinates: true, ..clamped() };
    assert_eq!(red(&plane, &sampler, [1.5, 0.5, 0.0]), 5.0);
    assert_eq!(red(&plane, &sampler, [2.0, 0.5, 0.0]), 4.0);
}

#[test]
fn the_filter_changes_where_the_level_of_detail_passes_zero() {
    let plane = floats(ImageShape::plane(2, 1), &[0.0, 8.0]);
    let sampler = Sampler { mag_filter: Filter::Nearest, ..clamped() };
    let value = |lod| color(&lookup(&plane, &sampler, [0.375, 0.5, 0.0]), lod)[0];
    // u = 0.75: texel 0; or 0.75 * 0 + 0.25 * 8.
    assert_eq!([-1.0, 0.0, 0.5].map(value), [0.0, 0.0, 2.0]);
}

#[test]
fn references_are_clamped_for_fixed_point_only() {
    let compare = |image: &Image, reference| {
        let sampler = Sampler { compare_op: Some(CompareOp::Equal), ..clamped() };
        let lookup = Lookup { reference: Some(reference), ..lookup(image, &sampler, [0.5, 0.5, 0.0]) };
        color(&lookup, 0.0)[0]
    };
    let unorm = Image::new(Format::new(Component::Unorm16, 1), ImageShape::plane(1, 1), &[0xff; 2]).unwrap();
    let float = floats(ImageShape::plane(1, 1), &[1.0]);
    assert_eq!([0.5, 1.0, 3.0].map(|reference| compare(&unorm, reference)), [0.0, 1.0, 1.0]);
    assert_eq!([1.0, 3.0, f32::NAN].map(|reference| compare(&float, reference)), [1.0, 0.0, 0.0]);
}

#[test]
fn cubes_are_seamless_and_arrays_choose_by_the_last_coordinate() {
    // Face f of cube c is 10 c + f, of 2 x 2 texels.
    let texels: Vec<f32> = [0.0, 10.0].iter().flat_map(|c| (0..6).map(move |f| c + f as f32)).collect();
    let texels: Vec<f32> = texels.iter().flat_map(|&value| [value; 4]).collect();
    let shape = ImageShape { dimension: Dimension::CubeArray, layers: 12, ..ImageShape::plane(2, 2) };
    let cubes = floats(shape, &texels);
    let sampler = Sampler::default();
    let value = |at, layer| color(&Lookup { layer, ..lookup(&cubes, &sampler, at) }, 0.0)[0];
    assert_eq!(value([-1.0, 0.0, 0.0], 1.0), 11.0);
    // On face -z: s_c = -x = 0.75 gives s = 0.875, u = 1.75: 0.25 of what lies right of it, -x (1).
    assert_eq!(value([-0.75, 0.0, -1.0], 0.0), 0.75 * 5.0 + 0.25 * 1.0);
    assert_eq!(value([-0.75, 0.0, -1.0], 9.0), 0.75 * 15.0 + 0.25 * 11.0);
    // Nearest filters stay on the face.
    let nearest = Sampler { mag_filter: Filter::Nearest, ..sampler };
    assert_eq!(red(&cubes, &nearest, [-1.0, 0.0, -1.0]), 5.0);
}

#[test]
fn gradients_of_a_cube_are_those_on_its_face() {
    // Levels of 4, 2, 1 texels: all of level n is n.
    let shape = ImageShape { dimension: Dimension::Cube, layers: 6, levels: 3, ..ImageShape::plane(4, 4) };
    let texels: Vec<f32> = (0..3).flat_map(|n| vec![n as f32; shape.level_texels(n) as usize]).collect();
    let cube = floats(shape, &texels);
    let sampler = Sampler::default();
    let lookup = lookup(&cube, &sampler, [0.0, 0.0, 2.0]);
    // ds_face = dx / (2 * 2) = 0.5 of four texels: two texels, level 1. Along z nothing moves.
    let value = |by_x| f32::from_bits(lookup.sample(Lod::Gradients([by_x, [0.0; 3]]), 0.0, 0.0)[0] as u32);
    assert_eq!(value([2.0, 0.0, 0.0]), 1.0);
    assert_eq!(value([0.0, 0.0, 2.0]), 0.0);
    assert_eq!(value([f32::NAN; 3]), 0.0);
}

#[test]
fn integers_are_gathered_and_sampled_unfiltered() {
    let format = Format::new(Component::Sint8, 2);
    let image = Image::new(format, ImageShape::plane(2, 1), &[0xff, 1, 2, 3]).unwrap();
    let sampler = clamped();
    let lookup = lookup(&image, &sampler, [0.5, 0.5, 0.0]);
    assert_eq!(lookup.sample(Lod::Explicit(0.0), 0.0, 0.0), [2, 3, 0, 1]);
    // v = 0.5: j0 = 0, j1 = 1 is clamped to the only row.
    assert_eq!(lookup.gather(0, None), [-1i64 as u64, 2, 2, -1i64 as u64]);
    assert_eq!(lookup.gather(3, None), [1; 4]);
}
