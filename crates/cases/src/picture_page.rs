//! Pages in HTML about pictures: of a launch that was looked at, and of a picture that is not as a
//! test expects.

use crate::drawing::heat_map::{HeatMap, HeatScale, Palette, number};
use crate::drawing::page::{
    HtmlPage, NumberEncoding, PageExplanations, PageInvocations, PageLayer, PagePicture,
};
use crate::expect::PictureDifference;
use crate::observe::fresh_resources;
use crate::pixel_cost::{Heat, HeatMeasure, InvocationPlane, worst_pixels};
use anyhit_base::count::grouped;
use anyhit_base::error::Result;
use anyhit_base::progress::Work;
use anyhit_base::threads::{map_on_threads, thread_count};
use anyhit_debugger::line_recorder::FollowedRuns;
use anyhit_debugger::source_text::source_text;
use anyhit_debugger::{ExplainRequest, Session};
use anyhit_explain::render::{self, RenderOptions};
use anyhit_scene::Files;
use anyhit_scene::frame::SinglePass;
use anyhit_scene::image::{Picture, PixelEncoding, Rgba8};

/// Pictures of at most so many pixels have all of them explained.
const EXPLAINED_WHOLE: u64 = 4096;

/// About how many pixels of a grid are explained of larger pictures.
const EXPLAINED_GRID: u64 = 256;

/// How many of the worst pixels a page lists.
pub const WORST: usize = 16;

/// Pixels to explain, and in words which these are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChosenPixels {
    /// The pixels.
    pub pixels: Vec<[u32; 2]>,
    /// Which these are.
    pub which: String,
}

impl ChosenPixels {
    /// Of a small picture all pixels; of others those that are asked for and those of a grid.
    pub fn of(plane: &InvocationPlane, asked: &[[u32; 2]]) -> Self {
        let ([width, height], word) = (plane.extent, plane.kind.word());
        let count = u64::from(width) * u64::from(height);
        if count <= EXPLAINED_WHOLE {
            let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).collect();
            return Self { pixels, which: format!("all {word}s") };
        }
        let mut pixels: Vec<[u32; 2]> = Vec::new();
        let step = (count.div_ceil(EXPLAINED_GRID) as f64).sqrt().ceil() as usize;
        let along = |side: u32| (step as u32 / 2..side).step_by(step);
        let grid = along(height).flat_map(|y| along(width).map(move |x| [x, y]));
        for pixel in asked.iter().copied().chain(grid) {
            if !pixels.contains(&pixel) {
                pixels.push(pixel);
            }
        }
        let (all, explained) = (grouped(count), pixels.len());
        let which = format!(
            "{explained} of {all} {word}s: every {step}th of every {step}th row, the requested ones and \
             the worst"
        );
        Self { pixels, which }
    }
}

/// Explains the invocations of pixels, each on resources as the scene describes them, with the text
/// that `anyhit trace-one-ray` prints. What cannot be explained is left out. The passes before run
/// once, and again for the lines of each pixel.
pub fn explain(
    session: &Session,
    pass: Option<&str>,
    plane: &InvocationPlane,
    scene_name: Option<&str>,
    pixels: &[[u32; 2]],
) -> Vec<([u32; 2], String)> {
    let resources = fresh_resources(session.assembled());
    let Ok(begin) = session.beginning(pass, resources) else { return Vec::new() };
    let Ok(single) = session.assembled().single_pass(pass) else { return Vec::new() };
    let dispatch = match single {
        SinglePass::Launch(_) => None,
        SinglePass::Dispatch(single) => Some(single.index),
    };
    let text = |session: &Session, pixel: [u32; 2]| {
        let id = plane.id(pixel);
        let request = match (dispatch, pass) {
            (Some(dispatch), _) => ExplainRequest::Invocation { dispatch, id },
            (None, Some(pass)) => {
                ExplainRequest::InPass(pass.to_owned(), Box::new(ExplainRequest::Pixel(id)))
            }
            (None, None) => ExplainRequest::Pixel(id),
        };
        let (mut transcript, _) = session.run_from(&begin, &request).ok()?;
        let scene = session.scene();
        let mut read = |name: &str| source_text(&scene.path, name, &mut |path| scene.files.read(path).ok());
        let runs = FollowedRuns::of_sample(&transcript, 0);
        // Without lines an explanation is worth as much as before.
        let _ = session.add_lines(&request, &mut transcript, runs, &mut read);
        if let Some(name) = scene_name {
            name.clone_into(&mut transcript.scene);
        }
        let options = RenderOptions { summary: true, ..RenderOptions::default() };
        Some((pixel, render::text(&transcript, options)))
    };
    let work = Work::counted("explaining pixels", pixels.len() as u64);
    // Sessions are not shared between threads.
    let shares: Vec<_> = pixels.chunks(pixels.len().div_ceil(thread_count()).max(1)).collect();
    let explained = map_on_threads(shares.len(), |at| {
        let session = session.copied();
        let explained = shares[at].iter().filter_map(|&pixel| {
            let text = text(&session, pixel);
            work.advance(1);
            text
        });
        explained.collect::<Vec<_>>()
    });
    explained.into_iter().flatten().collect()
}

/// The heat map of numbers. Its last colour is for `top`, else for the greatest number.
pub fn heat_map(heat: &Heat, top: Option<f64>) -> HeatMap<'_> {
    let [most] = heat.percentiles([100]);
    let (scale, most) = match heat.measure {
        HeatMeasure::Ulps => (HeatScale::Logarithmic, most),
        HeatMeasure::Divergence => (HeatScale::Linear, 100.0),
        _ => (HeatScale::Linear, most),
    };
    let (extent, values, top) = (heat.extent, &heat.values, top.unwrap_or(most));
    HeatMap { extent, values, top, scale, palette: Palette::Viridis }
}

/// Lines about all numbers of a heat map.
pub fn heat_facts(heat: &Heat) -> Vec<String> {
    let [least, median, most_of_90, most_of_99, most] = heat.percentiles([0, 50, 90, 99, 100]).map(number);
    let mean = number(heat.mean());
    let sum = match heat.measure {
        HeatMeasure::Divergence | HeatMeasure::Ulps => format!("mean {mean}"),
        _ => format!("total {}, mean {mean}", number(heat.total())),
    };
    vec![sum, format!("min {least}, median {median}, 90 % {most_of_90}, 99 % {most_of_99}, max {most}")]
}

/// The layer of a page for a heat map.
///
/// # Errors
/// Of encoding its picture.
pub fn heat_layer(heat: &Heat, top: Option<f64>) -> Result<PageLayer> {
    let mut layer = PageLayer::new(heat.measure.name(), &heat.title(), &heat_map(heat, top))?;
    layer.facts = heat_facts(heat);
    (layer.worst, layer.ties) = heat.worst(WORST);
    Ok(layer)
}

/// The picture of a page for an image and the pixels that an encoding makes of it.
///
/// # Errors
/// Errors of the PNG encoder.
pub fn page_picture(
    name: &str,
    pixels: &Rgba8,
    image: &Picture,
    encoding: PixelEncoding,
) -> Result<PagePicture> {
    let picture = PagePicture::new(name, pixels)?.encoded(number_encoding(image, encoding));
    Ok(with_floats(picture, Some(image)))
}

fn number_encoding(image: &Picture, encoding: PixelEncoding) -> NumberEncoding {
    match encoding.to_srgb || image.format.srgb {
        true => NumberEncoding::Srgb,
        false => NumberEncoding::Stored,
    }
}

/// Adds the numbers of an image of floats to its picture.
fn with_floats(picture: PagePicture, image: Option<&Picture>) -> PagePicture {
    let Some(image) = image.filter(|image| image.format.is_float()) else { return picture };
    let channels = image.format.channels;
    let numbers = image.numbers();
    let texels = numbers.chunks_exact(4).flat_map(|texel| &texel[..usize::from(channels)]);
    picture.with_floats(channels, &texels.map(|&number| number as f32).collect::<Vec<f32>>())
}

/// The pictures of a page that compares two, and the layer of their differences.
///
/// # Errors
/// Of encoding the pictures.
pub fn comparison(compared: &PictureDifference) -> Result<(Vec<PagePicture>, PageLayer)> {
    let [expected, found] = &compared.sources;
    // A file is encoded as what it is compared with.
    let source = [expected, found].map(Option::as_ref);
    let encoding = source[1].or(source[0]).map(|(picture, encoding)| number_encoding(picture, *encoding));
    let picture = |name: &str, pixels: &Rgba8, source: Option<&(Picture, PixelEncoding)>| {
        let picture = PagePicture::new(name, pixels)?.encoded(encoding.unwrap_or(NumberEncoding::Stored));
        Result::Ok(with_floats(picture, source.map(|(picture, _)| picture)))
    };
    let pictures = vec![
        picture("found", &compared.found, source[1])?,
        picture("expected", &compared.expected, source[0])?,
        PagePicture::new("difference", &compared.difference())?,
    ];
    let distances: Vec<f64> = compared.distances().into_iter().map(f64::from).collect();
    let count = distances.iter().filter(|&&distance| distance > 0.0).count();
    let extent = compared.found.extent;
    let (worst, ties) = worst_pixels(extent, &distances, WORST);
    let most = worst.first().map_or(0.0, |(_, most)| *most);
    let map = HeatMap {
        extent,
        values: &distances,
        top: most,
        scale: HeatScale::Linear,
        palette: Palette::Magnitude,
    };
    let mut layer = PageLayer::new("difference", "greatest difference in a channel, out of 255", &map)?;
    let all = grouped(distances.len());
    layer.facts = vec![format!("{} of {all} pixels differ, by at most {most}", grouped(count))];
    (layer.worst, layer.ties) = (worst, ties);
    Ok((pictures, layer))
}

/// The invocations that the pixels of a plane stand for, as a page shows them.
pub fn page_invocations(plane: &InvocationPlane) -> PageInvocations {
    PageInvocations {
        word: plane.kind.word(),
        size: plane.size,
        stride: plane.stride,
        dimensions: plane.dimensions(),
    }
}

/// The page for a picture of a test that is not as expected, with the explanations of the pixels
/// that differ most where there is a session of the scene.
///
/// # Errors
/// Of encoding the pictures.
pub fn failed_picture(
    test: &str,
    compared: &PictureDifference,
    session: Option<&Session>,
    command: Option<[String; 2]>,
) -> Result<HtmlPage> {
    let (pictures, layer) = comparison(compared)?;
    let mut worst: Vec<[u32; 2]> = layer.worst.iter().map(|(pixel, _)| *pixel).collect();
    worst.retain(|pixel| *pixel != compared.worst);
    worst.insert(0, compared.worst);
    let [width, height] = compared.found.extent;
    let plane = InvocationPlane::of_launch([width, height, 1]);
    let explained = session.map_or_else(Vec::new, |session| explain(session, None, &plane, None, &worst));
    let which = format!("the {} pixels that differ most", explained.len());
    Ok(HtmlPage {
        title: format!("{test}: image `{}` is not as expected", compared.name),
        facts: layer.facts.clone(),
        extent: compared.found.extent,
        invocations: page_invocations(&plane),
        pictures,
        layers: vec![layer],
        shown: None,
        selected: Some(compared.worst),
        explanations: (!explained.is_empty()).then(|| PageExplanations::new(&explained, which)),
        command,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use anyhit_scene::{DiskFiles, LoadOptions, load};

    /// The second pass reads what the first has written to one image, and writes the other. It has
    /// four invocations in a row.
    #[test]
    fn pixels_are_explained_as_if_each_were_the_only_one() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .join("shaders/pass/frames/ping-pong/scene.toml");
        let scene = load(&path, &DiskFiles, &LoadOptions::default()).unwrap();
        let session = Session::new(scene).unwrap();
        let pixels = [[0, 0], [1, 0], [0, 1], [3, 0], [1, 0]];
        let plane = InvocationPlane::of_launch([4, 1, 1]);
        let explained = explain(&session, Some("ao"), &plane, None, &pixels);
        let inside = [[0, 0], [1, 0], [3, 0], [1, 0]];
        assert_eq!(explained.iter().map(|(pixel, _)| *pixel).collect::<Vec<_>>(), inside);
        for ([x, y], text) in explained {
            let pixel = ExplainRequest::Pixel([x, y, 0]);
            let request = ExplainRequest::InPass("ao".to_owned(), Box::new(pixel));
            let files = &session.scene().files;
            let mut read = |name: &str| source_text(&path, name, &mut |path| files.read(path).ok());
            let follow = |transcript: &_| FollowedRuns::of_sample(transcript, 0);
            let alone = session.copied().run_with_lines(&request, &follow, &mut read).unwrap().0;
            let options = RenderOptions { summary: true, ..RenderOptions::default() };
            assert_eq!(text, render::text(&alone, options), "({x}, {y})");
        }
        assert!(explain(&session, Some("none"), &plane, None, &pixels).is_empty());
    }

    #[test]
    fn small_pictures_are_explained_whole() {
        let all = ChosenPixels::of(&InvocationPlane::of_launch([64, 64, 1]), &[[1, 1]]);
        assert_eq!((all.pixels.len(), all.which.as_str()), (4096, "all pixels"));
        assert_eq!(all.pixels[65], [1, 1]);
    }

    #[test]
    fn large_ones_by_what_is_asked_for_and_a_grid() {
        // 1,000 x 600 are 600,000 pixels; a 256th of them are 2,344, and 48.4 squared.
        let plane = InvocationPlane::of_launch([1000, 600, 1]);
        let some = ChosenPixels::of(&plane, &[[999, 599], [24, 24], [999, 599]]);
        assert_eq!(some.pixels[..3], [[999, 599], [24, 24], [73, 24]]);
        // Columns 24, 73, ..., 955 or 998, rows 24, 73, ..., 563.
        assert_eq!(some.pixels.len(), 20 * 12 + 1);
        assert!(
            some.which.starts_with("241 of 600,000 pixels: every 49th of every 49th row"),
            "{}",
            some.which
        );
    }

    #[test]
    fn the_distance_of_pixels_is_that_of_their_farthest_channels() {
        let picture = |pixels: &[u8]| pixels.to_vec();
        let (one, other) = (picture(&[1, 2, 3, 4, 9, 9, 9, 9]), picture(&[1, 5, 2, 4, 9, 9, 9, 9]));
        let compared = PictureDifference::new("p", [2, 1], one, other).expect("pictures of one size");
        assert_eq!(compared.distances(), [3, 0]);
        assert_eq!(comparison(&compared).expect("pictures").1.worst, [([0, 0], 3.0)]);
    }
}
