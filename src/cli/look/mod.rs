//! `--heat`, `--profile` and `--html` of `render` and `run`: where the cost of a launch or dispatch
//! is, as a picture, by source line, and on a page.

mod heat;
mod page;

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::cli::look::heat::{format_heat, heat_json};
use crate::cli::{numbers, output};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::{atomic_file, escape};
use anyhit_cases::drawing::flame_graph;
use anyhit_cases::picture_page::{heat_facts, heat_map};
use anyhit_cases::pixel_cost::profile::Profile;
use anyhit_cases::pixel_cost::{Heat, HeatMeasure, InvocationPlane, LaunchCost, measure};
use anyhit_cases::rendering::output_image;
use anyhit_cases::stability::deep_copy;
use anyhit_cases::stability::shadow::texel_errors;
use anyhit_debugger::{Session, command, shell};
use anyhit_engine::machine::image::Image;
use anyhit_scene::frame::SinglePass;
use anyhit_scene::image::{PictureKind, PixelEncoding, write_picture};
use anyhit_scene::{Assembled, ResolvedScene};

/// Options for heat maps, profiles and pages.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Heat maps, profiles and pages")]
pub(super) struct LookArgs {
    /// Count the cost of each invocation and draw a heat map to --output [default: heat.png]; the
    /// worst invocations are printed as commands that explain them (docs/looking.md describes the
    /// measures)
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
    /// [default: the first launch, or the first dispatch of a scene without launches]
    #[arg(long, value_name = "NAME|N")]
    pass: Option<String>,
}

/// Options of the command besides [`LookArgs`].
#[derive(Clone, Copy, Debug)]
pub(super) struct RerunContext<'a> {
    /// The scene that is measured.
    pub scene: LookedScene<'a>,
    /// The flags that the explanation of a pixel needs, too, as a shell takes them.
    pub flags: &'a str,
    /// `--output`
    pub output: Option<&'a Path>,
    /// `--json`
    pub json: bool,
    /// `--alpha`
    pub keep_alpha: bool,
}

/// The measured scene, as commands that explain it name it.
#[derive(Clone, Copy, Debug)]
pub(super) enum LookedScene<'a> {
    /// The built-in demo.
    Demo,
    /// A scene file.
    File(&'a Path),
    /// A run that no command explains: a module without a scene, or one with another memory policy.
    Unnamed,
}

/// A command that explains an invocation: what is before and behind its ID.
type ExplainCommand = [String; 2];

/// A loaded scene and the pass of it that is measured.
struct Subject<'a> {
    session: &'a Session,
    single: SinglePass<'a>,
    context: RerunContext<'a>,
    command: Option<ExplainCommand>,
}

impl LookArgs {
    /// Returns true if one of the outputs is requested.
    pub(super) fn is_requested(&self) -> bool {
        self.heat.is_some() || self.profile.is_some() || self.html.is_some()
    }

    /// Refuses what cannot be written, before anything is computed.
    ///
    /// # Errors
    /// `InvalidArgument`, and `UnsupportedTool` for what this build lacks.
    pub(super) fn check(&self, output: Option<&Path>, json: bool) -> Result<()> {
        if json && self.is_requested() && self.heat.is_none() {
            return Err(invalid("`--json` requires --heat: `--profile` and `--html` print no JSON"));
        }
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
        self.explain.iter().try_for_each(|id| explained_id(id).map(|_| ()))
    }

    /// Refuses other modes of a command, each with its name, that were requested together with
    /// these options.
    ///
    /// # Errors
    /// `InvalidArgument`
    pub(super) fn check_alone(&self, others: &[(bool, &str)]) -> Result<()> {
        match others.iter().find(|(requested, _)| *requested) {
            Some((_, other)) => {
                let message = format!("`--heat`, `--profile` and `--html` cannot be used with {other}");
                Err(invalid(message))
            }
            None => Ok(()),
        }
    }

    /// Runs the scene's passes and counts what one of them costs; writes and prints what is asked
    /// for.
    ///
    /// # Errors
    /// Of the run, and of writing.
    pub(super) fn run(&self, scene: ResolvedScene, context: RerunContext<'_>) -> Result<()> {
        let session = Session::new(scene)?;
        output::notes(&session.assembled().notes);
        let single = session.assembled().single_pass(self.pass.as_deref())?;
        let command = self.command(&single, context);
        let subject = Subject { session: &session, single, context, command };
        let run = deep_copy(session.assembled());
        // Rounding errors need a run of their own.
        let only_ulps = self.heat == Some(HeatMeasure::Ulps) && self.profile.is_none() && self.html.is_none();
        let cost = match only_ulps {
            true => None,
            false => Some(measure(session.assembled(), &subject.single, &run.resources)?),
        };
        let printed = run.resources.printed.as_deref();
        printed.map_or(Ok(false), output::printed)?;
        let (plane, heat) = self.heat(&subject, cost.as_ref())?;
        if let (Some(path), Some(cost)) = (&self.profile, &cost) {
            write_profile(path, &subject, cost)?;
        }
        if let (Some(path), Some(cost)) = (&self.html, &cost) {
            let page = self.page(&subject, &run, cost, heat.as_ref())?;
            atomic_file::write(path, page.html())?;
        }
        match (&heat, context.output) {
            (Some(heat), output) => {
                let file = output.map_or_else(|| PathBuf::from("heat.png"), Path::to_path_buf);
                self.write_heat(&file, heat, &plane)?;
                if output.is_none() {
                    output::hint(format_args!("the heat map is in {}", escape::path(&file)));
                }
                output::print(match context.json {
                    true => heat_json(heat, &plane, subject.command.as_ref()),
                    false => format_heat(heat, &plane, subject.command.as_ref()),
                })
            }
            (None, Some(file)) => {
                let (_, image, encoding) = output_of(&session, &run, context.keep_alpha)?;
                write_picture(file, image, encoding)
            }
            (None, None) => Ok(()),
        }
    }

    /// The numbers of the requested measure, on the plane of all invocations.
    fn heat(
        &self,
        subject: &Subject<'_>,
        cost: Option<&LaunchCost>,
    ) -> Result<(InvocationPlane, Option<Heat>)> {
        let (session, single) = (subject.session, &subject.single);
        let plane_of = |size| InvocationPlane::of(size, single.workgroup_size());
        let plane = cost.map_or_else(|| plane_of(single.size()), |cost| cost.plane);
        match (self.heat, cost) {
            (None, _) => Ok((plane, None)),
            (Some(measure), Some(cost)) if measure != HeatMeasure::Ulps => {
                Ok((plane, Some(cost.heat(measure, &plane)?)))
            }
            (Some(measure), _) => {
                let (size, errors) = texel_errors(session.scene(), session.assembled(), single)?;
                let plane = plane_of(size);
                Ok((plane, Some(Heat::new(measure, &plane, &errors))))
            }
        }
    }

    fn write_heat(&self, file: &Path, heat: &Heat, plane: &InvocationPlane) -> Result<()> {
        let mut lines = vec![format!("{}, {}", heat.title(), plane.size_words())];
        lines.extend(heat_facts(heat));
        atomic_file::write(file, heat_map(heat, self.heat_max).picture(&lines).encode_png()?)
    }

    /// The command that explains an invocation of a pass, if one does.
    fn command(&self, single: &SinglePass<'_>, context: RerunContext<'_>) -> Option<ExplainCommand> {
        let scene = match context.scene {
            LookedScene::Demo => String::new(),
            LookedScene::File(path) => format!(" {}", shell::word(&path.to_string_lossy())),
            LookedScene::Unnamed => return None,
        };
        let flag = match single {
            SinglePass::Launch(_) => "--pixel",
            SinglePass::Dispatch(_) => "--invocation",
        };
        let pass = self.pass.as_ref().map(|pass| format!(" --pass {}", shell::word(pass)));
        Some([
            format!("anyhit trace-one-ray{scene} {flag} "),
            format!("{}{}", context.flags, pass.unwrap_or_default()),
        ])
    }
}

fn write_profile(path: &Path, subject: &Subject<'_>, cost: &LaunchCost) -> Result<()> {
    let scene = subject.session.scene();
    let folded = Profile::of_pass(scene, &subject.single, &cost.calls)?.folded();
    let title = format!("{}: SPIR-V instructions by line", escape::path(&scene.path));
    match extension(path).as_deref() {
        Some("svg") => atomic_file::write(path, flame_graph::svg(&folded, &title)?),
        _ => atomic_file::write(path, folded),
    }
}

/// The output image that a run has left, with its name and the encoding of its picture.
fn output_of<'a>(
    session: &'a Session,
    run: &'a Assembled,
    keep_alpha: bool,
) -> Result<(&'a str, &'a Image, PixelEncoding)> {
    let found = output_image(session.scene(), &run.resources);
    let (output, image) = found.ok_or_else(|| {
        let message = "the scene has no output image";
        Error::new(ErrorKind::InvalidScene, message)
            .at(Place::File(session.scene().path.clone()))
            .note("help: set `output = true` on one storage image")
    })?;
    let mut encoding = session.scene().encoding_of(output);
    encoding.keep_alpha |= keep_alpha;
    Ok((&output.name, image, encoding))
}

/// Parses a measure, and lists them in the help.
fn measures() -> impl TypedValueParser<Value = HeatMeasure> {
    PossibleValuesParser::new(HeatMeasure::ALL.map(HeatMeasure::name)).map(|name| {
        let found = HeatMeasure::ALL.into_iter().find(|one| one.name() == name);
        found.unwrap_or(HeatMeasure::Instructions)
    })
}

/// An ID of `--explain`.
fn explained_id(text: &str) -> Result<[u32; 3]> {
    command::pixel(text).map_err(|_| {
        invalid(format!("`--explain {text}` is not X,Y or X,Y,Z")).note("for example `--explain 470,220`")
    })
}

fn extension(path: &Path) -> Option<String> {
    path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase)
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
