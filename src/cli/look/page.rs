//! The page of `--html`: an output image with a pixel for each invocation, heat maps, explanations,
//! and another picture for comparison.

use crate::cli::look::{LookArgs, LookedScene, Subject, explained_id, invalid, output_of};
use anyhit_base::error::{Error, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, read_argument};
use anyhit_base::threads::map_on_threads;
use anyhit_cases::drawing::page::{HtmlPage, PageExplanations, PageLayer};
use anyhit_cases::expect::PictureDifference;
use anyhit_cases::picture_page::{
    ChosenPixels, comparison, explain, heat_layer, page_invocations, page_picture,
};
use anyhit_cases::pixel_cost::{Heat, HeatMeasure, InvocationPlane, LaunchCost, PlaneKind};
use anyhit_scene::image::{Picture, PixelEncoding, Rgba8};
use anyhit_scene::{Assembled, Files, ResolvedScene};

/// The output image, as a page shows it.
struct ShownImage<'a> {
    name: &'a str,
    /// The part of the plane of invocations that it shows.
    plane: InvocationPlane,
    picture: Picture,
    encoding: PixelEncoding,
    pixels: Rgba8,
}

impl LookArgs {
    /// The page of a run that was measured. Where no output image has a pixel for each invocation,
    /// it shows the heat maps alone, and says why.
    ///
    /// # Errors
    /// `InvalidArgument` for a pixel of `--explain` that the page does not show, and for
    /// `--compare` without an image; errors of reading and encoding pictures.
    pub(super) fn page(
        &self,
        subject: &Subject<'_>,
        run: &Assembled,
        cost: &LaunchCost,
        heat: Option<&Heat>,
    ) -> Result<HtmlPage> {
        let session = subject.session;
        let image = shown_image(subject, run, &cost.plane);
        let plane = image.as_ref().map_or_else(|_| cost.plane, |image| image.plane);
        let mut layers = self.layers(cost, heat, &plane)?;
        let mut pictures = Vec::new();
        let mut wanted: Vec<[u32; 2]> =
            self.explain.iter().map(|text| explained_pixel(text, &plane)).collect::<Result<_>>()?;
        match &image {
            Ok(image) => {
                if let Some(compared) = self.compared(session.scene(), image)? {
                    let (compared, layer) = comparison(&compared)?;
                    pictures = compared;
                    wanted.extend(layer.worst.iter().map(|(pixel, _)| *pixel));
                    layers.push(layer);
                } else {
                    pictures.push(page_picture(image.name, &image.pixels, &image.picture, image.encoding)?);
                }
            }
            Err(why) if self.compare.is_some() => return Err(why.clone()),
            Err(_) => {}
        }
        let shown = heat.map(|heat| heat.measure.name().to_owned());
        let shown_layer = layers.iter().find(|layer| Some(&layer.name) == shown.as_ref()).or(layers.first());
        let worst = shown_layer.and_then(|layer| layer.worst.first()).map(|(pixel, _)| *pixel);
        let selected = wanted.first().copied().or(worst);
        wanted.extend(layers.iter().flat_map(|layer| &layer.worst).map(|(pixel, _)| *pixel));
        let chosen = ChosenPixels::of(&plane, &wanted);
        let scene_name =
            matches!(subject.context.scene, LookedScene::Demo).then_some("swept-spheres (built-in)");
        let explained = explain(session, self.pass.as_deref(), &plane, scene_name, &chosen.pixels);
        let path = escape::path(&session.scene().path);
        let title = scene_name.map_or_else(|| path.to_string(), str::to_owned);
        let [width, height] = plane.extent;
        let size = match plane.kind {
            PlaneKind::Launch => plane.size_words(),
            PlaneKind::Dispatch(_) if image.is_ok() => {
                format!("{width} x {height} pixels of {}", plane.size_words())
            }
            PlaneKind::Dispatch(_) => plane.size_words(),
        };
        let (which, version) = (&chosen.which, env!("CARGO_PKG_VERSION"));
        let mut facts = vec![format!("{size}; this page explains {which}, by `anyhit {version}`")];
        if let Err(why) = &image {
            facts.push(format!("no picture: {}", why.message()));
        }
        Ok(HtmlPage {
            title,
            facts,
            extent: plane.extent,
            invocations: page_invocations(&plane),
            pictures,
            layers,
            shown,
            selected,
            explanations: Some(PageExplanations::new(&explained, chosen.which)),
            command: subject.command.clone(),
        })
    }

    /// The heat maps of a page: all that can be counted.
    fn layers(
        &self,
        cost: &LaunchCost,
        heat: Option<&Heat>,
        plane: &InvocationPlane,
    ) -> Result<Vec<PageLayer>> {
        let layer = |at: usize| {
            let measure = HeatMeasure::ALL[at];
            let requested = heat.filter(|heat| heat.measure == measure);
            let own = match requested {
                // The plane of all invocations has their numbers in launch order.
                Some(heat) => Heat::new(measure, plane, &heat.values),
                None if measure == HeatMeasure::Ulps => return None,
                None => cost.heat(measure, plane).ok()?,
            };
            // A dispatch calls no any-hit shader, and may trace nothing.
            let is_needless = plane.kind != PlaneKind::Launch
                && requested.is_none()
                && measure != HeatMeasure::Instructions
                && own.total() == 0.0;
            let top = self.heat_max.filter(|_| requested.is_some());
            (!is_needless).then(|| heat_layer(&own, top))
        };
        map_on_threads(HeatMeasure::ALL.len(), layer).into_iter().flatten().collect()
    }

    /// The picture to compare with, beside the image; `None` where none is asked for and none is
    /// beside the scene.
    fn compared(&self, scene: &ResolvedScene, image: &ShownImage<'_>) -> Result<Option<PictureDifference>> {
        let limits = &scene.files.limits;
        let (path, bytes) = match &self.compare {
            Some(path) => (path.clone(), read_argument(path, InputLimit::FileBytes, limits)?),
            None => {
                let beside = scene.path.with_file_name("expect.png");
                if !scene.path.ends_with("scene.toml") || !beside.exists() {
                    return Ok(None);
                }
                let bytes = scene.files.read(&beside)?;
                (beside, bytes)
            }
        };
        let decoded = Picture::decode_within(&path, &bytes, None, limits);
        let expected = match (decoded, &self.compare) {
            (Ok(picture), _) => picture,
            (Err(error), Some(_)) => return Err(error),
            // It may be there to be filled.
            (Err(_), None) => return Ok(None),
        };
        let extent = image.pixels.extent;
        let [[width, height], [a, b]] = [expected.extent, extent];
        match (expected.extent == extent, &self.compare) {
            (true, _) => {}
            (false, None) => return Ok(None),
            (false, Some(_)) => {
                let message = format!("the picture is {width} x {height}, but the rendering is {a} x {b}");
                return Err(invalid(message).at(Place::File(path.clone())));
            }
        }
        // Numbers become pixels as those of the image do; a file of pixels has them.
        let encoding = match expected.format.is_float() {
            true => image.encoding,
            false => PixelEncoding::STORED,
        };
        let pixels = expected.rgba8(encoding)?;
        let compared = PictureDifference::new(image.name, extent, pixels, image.pixels.pixels.clone());
        let sources = [Some((expected, encoding)), Some((image.picture.clone(), image.encoding))];
        Ok(compared.map(|compared| PictureDifference { sources, ..compared }))
    }
}

/// The output image, if it has a pixel for each invocation of a plane.
///
/// # Errors
/// Why the page has no picture.
fn shown_image<'a>(
    subject: &'a Subject<'_>,
    run: &'a Assembled,
    all: &InvocationPlane,
) -> Result<ShownImage<'a>> {
    let (name, image, encoding) = output_of(subject.session, run, subject.context.keep_alpha)?;
    let picture = Picture::of(image);
    let [width, height] = picture.extent;
    let plane = all.of_picture(picture.extent).ok_or_else(|| {
        let [x, y, z] = all.size;
        let what = match all.kind {
            PlaneKind::Launch => "launch is",
            PlaneKind::Dispatch(_) => "dispatch has",
        };
        let message = format!("the image `{name}` is {width} x {height}, but the {what} {x} x {y} x {z}");
        invalid(message + " invocations")
            .note("a picture has a pixel for each invocation; `--pass` selects another launch or dispatch")
    })?;
    let pixels = Rgba8 { extent: picture.extent, pixels: picture.rgba8(encoding)? };
    Ok(ShownImage { name, plane, picture, encoding, pixels })
}

/// The pixel of `--explain`.
fn explained_pixel(text: &str, plane: &InvocationPlane) -> Result<[u32; 2]> {
    plane.pixel(explained_id(text)?).ok_or_else(|| {
        let last = plane.extent.map(|side| side.saturating_sub(1));
        let (first, last) = (plane.id_words([0, 0]), plane.id_words(last));
        let error: Error = invalid(format!("`--explain {text}` is outside the picture"));
        error.note(format!("{}s range from {first} to {last}", plane.kind.word()))
    })
}
