//! `--heat`, `--profile` and `--html`: where the cost of a launch is, as a picture, by source line,
//! and on a page.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::{Value, json};

use crate::cli::{numbers, output};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::{InputLimit, read_argument};
use anyhit_base::sorted::json_object;
use anyhit_base::threads::map_on_threads;
use anyhit_base::{atomic_file, escape};
use anyhit_cases::drawing::flame_graph;
use anyhit_cases::drawing::heat_map::number;
use anyhit_cases::drawing::page::{HtmlPage, PageExplanations, PagePicture};
use anyhit_cases::expect::PictureDifference;
use anyhit_cases::picture_page::{
    ChosenPixels, WORST, comparison, explain, heat_facts, heat_layer, heat_map,
};
use anyhit_cases::pixel_cost::profile::Profile;
use anyhit_cases::pixel_cost::{Heat, HeatMeasure, LaunchCost, measure};
use anyhit_cases::rendering::output_image;
use anyhit_cases::stability::deep_copy;
use anyhit_cases::stability::shadow::texel_errors;
use anyhit_debugger::{Session, command, shell};
use anyhit_engine::machine::image::Image;
use anyhit_explain::names::Names;
use anyhit_scene::image::{Picture, PictureKind, PixelEncoding, Rgba8, write_picture};
use anyhit_scene::{Assembled, Files, ResolvedScene};

/// The version of what `--json` prints.
const VERSION: u32 = 1;

/// Where the cost of a launch is.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Heat maps, profiles and pages")]
pub(super) struct LookArgs {
    /// Count the cost of each pixel and draw a heat map to --output [default: heat.png]; the worst
    /// pixels are printed as commands that explain them (docs/looking.md describes the measures)
    #[arg(long, value_name = "MEASURE", value_parser = measures())]
    heat: Option<HeatMeasure>,
    /// With --heat: number from which on pixels have the last colour, so that two heat maps can be
    /// compared [default: the greatest]
    #[arg(long, value_name = "NUMBER", requires = "heat", value_parser = numbers::positive)]
    heat_max: Option<f64>,
    /// Write the instruction counts of every source line and call stack: folded stacks (.folded) or
    /// a flame graph (.svg, feature `flamegraph`)
    #[arg(long, value_name = "FILE")]
    profile: Option<PathBuf>,
    /// Write an HTML page: the picture with explanations of its pixels, heat maps as layers, and
    /// another picture for comparison
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// With --html: picture to compare with [default: `expect.png` beside the scene, if it exists
    /// and has the same size]
    #[arg(long, value_name = "PICTURE", requires = "html")]
    compare: Option<PathBuf>,
    /// With --html: also explain this pixel; may be repeated
    #[arg(long, value_name = "X,Y", requires = "html", allow_hyphen_values = true)]
    explain: Vec<String>,
    /// With --heat, --profile and --html: pass to examine, by its name or its number from 0
    /// [default: the first launch]
    #[arg(long, value_name = "NAME|N")]
    pass: Option<String>,
}

/// What else was given that commands to be pasted must repeat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Looked<'a> {
    /// The scene file; `None` for the built-in demo.
    pub scene: Option<&'a Path>,
    /// The flags that the explanation of a pixel needs, too, as a shell takes them.
    pub flags: &'a str,
    /// `--output`
    pub output: Option<&'a Path>,
    /// `--json`
    pub json: bool,
    /// `--alpha`
    pub keep_alpha: bool,
}

impl LookArgs {
    /// Whether anything is to be looked at.
    pub(super) fn is_requested(&self) -> bool {
        self.heat.is_some() || self.profile.is_some() || self.html.is_some()
    }

    /// Whether `--json` has something to print.
    pub(super) fn prints(&self) -> bool {
        self.heat.is_some()
    }

    /// Refuses what cannot be written, before anything is computed.
    ///
    /// # Errors
    /// `InvalidArgument`, and `UnsupportedTool` for what this build lacks.
    pub(super) fn check(&self, output: Option<&Path>) -> Result<()> {
        if self.pass.is_some() && !self.is_requested() {
            return Err(invalid("`--pass` requires --heat, --profile or --html"));
        }
        if self.heat.is_some()
            && let Some(path) = output
            && PictureKind::of(path) != Some(PictureKind::Png)
        {
            let name = escape::path(&path);
            return Err(invalid(format!("a heat map is a .png file, and `{name}` does not end in .png")));
        }
        if let Some(path) = &self.profile {
            match extension(path).as_deref() {
                Some("folded") => {}
                Some("svg") => flame_graph::check()?,
                _ => {
                    let message = format!(
                        "a profile is a .folded or .svg file, and `{}` ends in neither",
                        escape::path(&path)
                    );
                    return Err(invalid(message));
                }
            }
        }
        self.explain.iter().try_for_each(|pixel| asked(pixel).map(|_| ()))
    }

    /// Runs the scene's passes and counts what one of its launches costs; writes and prints what is
    /// asked for.
    ///
    /// # Errors
    /// Of the run, and of writing.
    pub(super) fn run(&self, scene: ResolvedScene, given: Looked<'_>) -> Result<()> {
        let session = Session::new(scene)?;
        output::notes(&session.assembled().notes);
        let run = deep_copy(session.assembled());
        let cost = self.measure(&session, &run)?;
        let printed = run.resources.printed.as_deref();
        printed.map_or(Ok(false), output::printed)?;
        let heat = self.heat.map(|measure| self.heat(measure, &session, cost.as_ref())).transpose()?;
        let command = self.command(given);
        if let (Some(path), Some(cost)) = (&self.profile, &cost) {
            self.write_profile(path, &session, cost)?;
        }
        if let (Some(path), Some(cost)) = (&self.html, &cost) {
            let page = self.page(&session, &run, cost, heat.as_ref(), given, &command)?;
            atomic_file::write(path, page.html())?;
        }
        match (&heat, given.output) {
            (Some(heat), output) => {
                let file = output.map_or_else(|| PathBuf::from("heat.png"), Path::to_path_buf);
                self.write_heat(&file, heat)?;
                if output.is_none() {
                    output::hint(format_args!("the heat map is in {}", escape::path(&file)));
                }
                output::print(if given.json { told_json(heat, &command) } else { told(heat, &command) })
            }
            (None, Some(file)) => {
                let (image, encoding) = output_of(&session, &run, given.keep_alpha)?;
                write_picture(file, image, encoding)
            }
            (None, None) => Ok(()),
        }
    }

    /// Counts what the launch costs; `None` where only rounding is asked for, which is run for
    /// itself.
    fn measure(&self, session: &Session, run: &Assembled) -> Result<Option<LaunchCost>> {
        let only_ulps = self.heat == Some(HeatMeasure::Ulps) && self.profile.is_none() && self.html.is_none();
        let single = session.assembled().single_launch(self.pass.as_deref())?;
        if only_ulps {
            return Ok(None);
        }
        measure(session.assembled(), &single, &run.resources).map(Some)
    }

    /// The numbers of a measure.
    fn heat(&self, measure: HeatMeasure, session: &Session, cost: Option<&LaunchCost>) -> Result<Heat> {
        match cost {
            Some(cost) if measure != HeatMeasure::Ulps => cost.heat(measure),
            _ => {
                let assembled = session.assembled();
                let single = assembled.single_launch(self.pass.as_deref())?;
                let launches =
                    assembled.passes[..single.number].iter().filter(|pass| pass.launch().is_some());
                let errors = texel_errors(session.scene(), assembled, launches.count(), single.size)?;
                Heat::new(measure, single.size, errors)
            }
        }
    }

    fn write_heat(&self, file: &Path, heat: &Heat) -> Result<()> {
        let [width, height] = heat.extent;
        let mut lines = vec![format!("{}, {width} x {height}", heat.measure.title())];
        lines.extend(heat_facts(heat));
        atomic_file::write(file, heat_map(heat, self.heat_max).picture(&lines).encode_png()?)
    }

    fn write_profile(&self, path: &Path, session: &Session, cost: &LaunchCost) -> Result<()> {
        let single = session.assembled().single_launch(self.pass.as_deref())?;
        let names = Names::new(session.scene(), single.index, &single.pipeline);
        let profile = Profile::new(&cost.calls, &single.pipeline, &names);
        let folded = profile.folded();
        let title = format!("{}: SPIR-V instructions by line", escape::path(&session.scene().path));
        match extension(path).as_deref() {
            Some("svg") => atomic_file::write(path, flame_graph::svg(&folded, &title)?),
            _ => atomic_file::write(path, folded),
        }
    }

    fn page(
        &self,
        session: &Session,
        run: &Assembled,
        cost: &LaunchCost,
        heat: Option<&Heat>,
        given: Looked<'_>,
        command: &[String; 2],
    ) -> Result<HtmlPage> {
        let (image, encoding) = output_of(session, run, given.keep_alpha)?;
        let name = session.scene().output().map_or("picture", |output| &output.name);
        let picture = Picture::of(image);
        let extent = picture.extent;
        let found = Rgba8 { extent, pixels: picture.rgba8(encoding)? };
        let [width, height] = extent;
        let is_launched = cost.size == [width, height, 1];
        if !is_launched {
            let [x, y, z] = cost.size;
            let message =
                format!("the image `{name}` is {width} x {height}, but the launch is {x} x {y} x {z}");
            return Err(invalid(message)
                .note("a page requires an image with a pixel per invocation; `--pass` selects a launch"));
        }
        let layer = |at: usize| {
            let measure = HeatMeasure::ALL[at];
            let own = match heat {
                Some(heat) if heat.measure == measure => heat.clone(),
                _ if measure == HeatMeasure::Ulps => return None,
                // What cannot be counted of this launch is no layer.
                _ => cost.heat(measure).ok()?,
            };
            Some(heat_layer(&own, self.heat_max.filter(|_| self.heat == Some(measure))))
        };
        let layers = map_on_threads(HeatMeasure::ALL.len(), layer).into_iter().flatten();
        let mut layers = layers.collect::<Result<Vec<_>>>()?;
        let shown = heat.map(|heat| heat.measure.name().to_owned());
        let mut pictures = vec![PagePicture::new(name, &found)?];
        let mut wanted: Vec<[u32; 2]> = Vec::new();
        for text in &self.explain {
            let [x, y] = asked(text)?;
            if x >= width || y >= height {
                let last = format!("pixels range from 0,0 to {},{}", width - 1, height - 1);
                return Err(invalid(format!("`--explain {text}` is outside the picture")).note(last));
            }
            wanted.push([x, y]);
        }
        if let Some(expected) = self.expected(session.scene(), extent)? {
            let compared = PictureDifference::new(name, extent, expected.pixels, found.pixels);
            if let Some(compared) = compared {
                let (compared, layer) = comparison(&compared)?;
                pictures = compared;
                wanted.extend(layer.worst.iter().map(|(pixel, _)| *pixel));
                layers.push(layer);
            }
        }
        let shown_layer = layers.iter().find(|layer| Some(&layer.name) == shown.as_ref()).or(layers.first());
        let worst = shown_layer.and_then(|layer| layer.worst.first()).map(|(pixel, _)| *pixel);
        let selected = wanted.first().copied().or(worst);
        wanted.extend(layers.iter().flat_map(|layer| &layer.worst).map(|(pixel, _)| *pixel));
        let chosen = ChosenPixels::of(extent, &wanted);
        let scene_name = given.scene.is_none().then_some("swept-spheres (built-in)");
        let explained = explain(session, self.pass.as_deref(), scene_name, &chosen.pixels);
        let path = escape::path(&session.scene().path);
        let title = scene_name.map_or_else(|| path.to_string(), str::to_owned);
        Ok(HtmlPage {
            title,
            facts: vec![format!(
                "{width} x {height} pixels; this page explains {}, by `anyhit {}`",
                chosen.which,
                env!("CARGO_PKG_VERSION")
            )],
            extent,
            pictures,
            layers,
            shown,
            selected,
            explanations: Some(PageExplanations::new(&explained, chosen.which)),
            command: Some(command.clone()),
        })
    }

    /// The picture to compare with; `None` where none is asked for and none is beside the scene.
    fn expected(&self, scene: &ResolvedScene, extent: [u32; 2]) -> Result<Option<Rgba8>> {
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
        let picture = match (decoded, &self.compare) {
            (Ok(picture), _) => picture,
            (Err(error), Some(_)) => return Err(error),
            // It may be there to be filled.
            (Err(_), None) => return Ok(None),
        };
        let [[width, height], [a, b]] = [picture.extent, extent];
        match (picture.extent == extent, &self.compare) {
            (true, _) => Ok(Some(Rgba8 { extent, pixels: picture.rgba8(PixelEncoding::STORED)? })),
            (false, None) => Ok(None),
            (false, Some(_)) => {
                let message = format!("the picture is {width} x {height}, but the rendering is {a} x {b}");
                Err(invalid(message).at(Place::File(path.clone())))
            }
        }
    }

    /// The command that explains a pixel, without its flag `--pixel X,Y`: what is before and behind
    /// it.
    fn command(&self, given: Looked<'_>) -> [String; 2] {
        let scene = given.scene.map(|path| format!(" {}", shell::word(&path.to_string_lossy())));
        let pass = self.pass.as_ref().map(|pass| format!(" --pass {}", shell::word(pass)));
        [
            format!("anyhit trace-one-ray{}", scene.unwrap_or_default()),
            format!("{}{}", given.flags, pass.unwrap_or_default()),
        ]
    }
}

/// The output image that a run has left, and the encoding of its picture.
fn output_of<'a>(
    session: &Session,
    run: &'a Assembled,
    keep_alpha: bool,
) -> Result<(&'a Image, PixelEncoding)> {
    let found = output_image(session.scene(), &run.resources);
    let (output, image) = found.ok_or_else(|| {
        let message = "the scene has no output image";
        Error::new(ErrorKind::InvalidScene, message)
            .at(Place::File(session.scene().path.clone()))
            .note("help: set `output = true` on one storage image")
    })?;
    let mut encoding = session.scene().encoding_of(output);
    encoding.keep_alpha |= keep_alpha;
    Ok((image, encoding))
}

/// A heat map as text.
fn told(heat: &Heat, command: &[String; 2]) -> String {
    let [width, height] = heat.extent;
    let mut text = format!("{}, {width} x {height} pixels\n", heat.measure.title());
    for line in heat_facts(heat) {
        text += &format!("  {line}\n");
    }
    let (worst, ties) = heat.worst(WORST);
    let worst: Vec<(String, String)> = worst
        .into_iter()
        .map(|([x, y], value)| (number(value), format!("{} --pixel {x},{y}{}", command[0], command[1])))
        .collect();
    if !worst.is_empty() {
        text += "worst pixels:\n";
    }
    let width = worst.iter().map(|(value, _)| value.len()).max().unwrap_or(0);
    for (value, command) in worst {
        text += &format!("  {value:>width$}  {command}\n");
    }
    if ties > 0 {
        text += &format!("  {} more pixels have the same number as the last one\n", number(ties as f64));
    }
    text
}

/// A heat map as JSON.
fn told_json(heat: &Heat, command: &[String; 2]) -> String {
    const PERCENTS: [u32; 5] = [0, 50, 90, 99, 100];
    let percentiles = heat.percentiles(PERCENTS);
    let percentiles = json_object(
        PERCENTS.iter().zip(percentiles).map(|(percent, value)| (percent.to_string(), json!(value))),
    );
    let (worst, ties) = heat.worst(WORST);
    let worst: Vec<Value> = worst
        .into_iter()
        .map(|([x, y], value)| {
            json!({
                "pixel": [x, y],
                "value": value,
                "command": format!("{} --pixel {x},{y}{}", command[0], command[1]),
            })
        })
        .collect();
    let all = json!({
        "version": VERSION,
        "measure": heat.measure.name(),
        "size": heat.extent,
        "total": heat.total(),
        "mean": heat.mean(),
        "percentiles": percentiles,
        "worst": worst,
        "ties": ties,
    });
    format!("{all:#}\n")
}

/// Parses a measure, and lists them in the help.
fn measures() -> impl TypedValueParser<Value = HeatMeasure> {
    PossibleValuesParser::new(HeatMeasure::ALL.map(HeatMeasure::name)).map(|name| {
        let found = HeatMeasure::ALL.into_iter().find(|one| one.name() == name);
        found.unwrap_or(HeatMeasure::Instructions)
    })
}

/// A pixel of `--explain`.
fn asked(text: &str) -> Result<[u32; 2]> {
    match command::pixel(text) {
        Ok([x, y, 0]) => Ok([x, y]),
        _ => Err(invalid(format!("`--explain {text}` is not X,Y")).note("for example `--explain 470,220`")),
    }
}

fn extension(path: &Path) -> Option<String> {
    path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase)
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
