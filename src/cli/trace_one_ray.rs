//! `anyhit trace-one-ray`: explains what a ray met and which shaders it called.

use std::io::stdout;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use crate::cli::compare::{self, Other};
use crate::cli::input::{SceneFileArgs, VariantArgs};
#[cfg(feature = "debugger")]
use crate::cli::interactive;
use crate::cli::limits::LimitArgs;
use crate::cli::many_seeds::{ManySeedsArgs, command_line};
use crate::cli::page_args::PageArgs;
use crate::cli::render::size;
use crate::cli::sanitize::SanitizeArgs;
use crate::cli::stability::StabilityArgs;
use crate::cli::{numbers, output, precision};
use crate::demo;
use anyhit_base::error::{Error, ErrorKind, Result};
#[cfg(feature = "debugger")]
use anyhit_debugger::debugger::Debugger;
use anyhit_debugger::session::{ExplainRequest, Session};
use anyhit_debugger::{command, source_text};
use anyhit_engine::geometry::Precision;
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine::LaunchLimits;
use anyhit_explain::Transcript;
use anyhit_explain::render::{self, RenderOptions};
use anyhit_scene::file::GivenRay;
use anyhit_scene::files::{DiskFiles, Files};
use anyhit_scene::{LoadOptions, ResolvedScene};

/// Trace one ray and explain every step.
///
/// Without a scene file, the built-in demo is used: a field of grass, spheres and chains.
#[derive(Args, Clone, Debug)]
#[command(group = ArgGroup::new("of_ray")
    .args(["t_min", "t_max", "flags", "cull_mask", "time", "sbt_offset", "sbt_stride", "miss_index"])
    .multiple(true)
    .conflicts_with_all(["pixel", "invocation"]))]
pub(super) struct TraceOneRayArgs {
    /// Scene file, or `-` for standard input
    #[arg(value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// Run the ray generation shader at this launch index
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true, conflicts_with = "ray")]
    pixel: Option<String>,
    /// Run the compute shader of a dispatch at this global invocation ID, with its workgroup
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with_all = ["ray", "pixel"])]
    invocation: Option<String>,
    /// With --invocation: number of the dispatch, from 0; the launch and the dispatches before it
    /// run first [default: 0]
    #[arg(long, value_name = "N", requires = "invocation")]
    dispatch: Option<usize>,
    /// Pass to examine, by its name or its number from 0; the passes before it run first [default:
    /// the first launch]
    #[arg(long, value_name = "NAME|N", conflicts_with = "dispatch")]
    pass: Option<String>,
    /// Trace this ray without a ray generation shader, or the scene's `[[ray]]` of this name
    #[arg(long, value_name = "OX,OY,OZ DX,DY,DZ", allow_hyphen_values = true)]
    ray: Option<String>,
    /// Width and height of the launch, instead of the scene's own, as for `anyhit render`
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Precision of intersections, instead of the scene's own; only `exact` is correct for every
    /// ray
    #[arg(long, value_name = "PRECISION", value_parser = precision::parser())]
    precision: Option<Precision>,
    /// Debug the run: step by line, forwards and backwards, with breakpoints and variables;
    /// commands are read from the terminal or standard input
    #[arg(long, short, conflicts_with_all = ["json", "all"])]
    interactive: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    page: PageArgs,
    #[command(flatten)]
    files: SceneFileArgs,
    #[command(flatten)]
    variant: VariantArgs,
    /// Show every instance and every primitive tested
    #[arg(long)]
    all: bool,
    /// With --ray: start of the ray's interval
    #[arg(long, value_name = "T", requires = "ray", allow_hyphen_values = true, value_parser = numbers::float)]
    t_min: Option<f32>,
    /// With --ray: end of the ray's interval
    #[arg(long, value_name = "T", requires = "ray", allow_hyphen_values = true, value_parser = numbers::float)]
    t_max: Option<f32>,
    /// With --ray: ray flags by name, or a number
    #[arg(long, value_name = "FLAGS", requires = "ray")]
    flags: Option<String>,
    /// With --ray: cull mask [default: 0xff]
    #[arg(long, value_name = "MASK", requires = "ray", value_parser = unsigned)]
    cull_mask: Option<u32>,
    /// With --ray: time of the ray, from 0 to 1, for moving instances and vertices [default: 0]
    #[arg(long, value_name = "TIME", requires = "ray", allow_hyphen_values = true, value_parser = numbers::ray_time)]
    time: Option<f32>,
    /// With --ray: SBT offset [default: 0]
    #[arg(long, value_name = "N", requires = "ray", value_parser = unsigned)]
    sbt_offset: Option<u32>,
    /// With --ray: SBT stride [default: 1]
    #[arg(long, value_name = "N", requires = "ray", value_parser = unsigned)]
    sbt_stride: Option<u32>,
    /// With --ray: miss index [default: 0]
    #[arg(long, value_name = "N", requires = "ray", value_parser = unsigned)]
    miss_index: Option<u32>,

    #[command(flatten)]
    stability: StabilityArgs,

    #[command(flatten)]
    sanitize: SanitizeArgs,

    #[command(flatten)]
    many_seeds: ManySeedsArgs,

    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// What the scene or the arguments lack, and the trap that ended a shader, after what happened
/// before it is printed.
pub(super) fn run(args: TraceOneRayArgs) -> Result<()> {
    args.sanitize.claim_stdout()?;
    let json = args.json;
    let trap = trace(args).map_err(|error| output::json_error(json, error))?;
    trap.map_or(Ok(()), Err)
}

/// Prints what was found; the error that it ended with is part of it.
fn trace(args: TraceOneRayArgs) -> Result<Option<Error>> {
    let request = match args.pass.clone() {
        Some(pass) => ExplainRequest::InPass(pass, Box::new(args.request()?)),
        None => args.request()?,
    };
    let mut scene = args.load(args.scene.as_deref(), args.precision)?;
    output::notes(&scene.notes);
    args.limits.limits(LaunchLimits::default()).give(&mut scene);
    // The program ends with this command, and the system takes all memory back at once.
    let session = ManuallyDrop::new(Session::new(scene)?);
    output::notes(&session.assembled().notes);
    let looks_otherwise = args.stability.is_requested()
        || args.sanitize.is_requested()
        || args.many_seeds.is_requested(&args.stability);
    if args.interactive && looks_otherwise {
        let message =
            "`--interactive` cannot be used with `--sanitize`, `--many-seeds`, `--shadow` or `--perturb`";
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    if args.stability.is_requested() {
        let (_, resolved) = session.resolve(&request)?;
        let found = args.stability.run(
            session.scene(),
            session.assembled(),
            Some(&resolved),
            args.json,
            args.many_seeds.perturbed_runs(),
        );
        return Ok(found.err());
    }
    if args.sanitize.is_requested() || args.many_seeds.is_requested(&args.stability) {
        let (_, resolved) = session.resolve(&request)?;
        let (scene, assembled) = (session.scene(), session.assembled());
        let command = args.repeated();
        let drawn =
            args.many_seeds.run_one(&args.sanitize, &args.stability, scene, assembled, &resolved, command)?;
        return Ok(args.sanitize.run_one(scene, assembled, &resolved, drawn).err());
    }
    let colour = output::is_coloured(&stdout());
    if args.interactive {
        args.debug(&session, &request, colour)?;
        return Ok(None);
    }
    if let Some(other) = &args.page.compare {
        let other = Other::parse(other)?;
        output::print(args.compare(&session, &request, other, colour)?)?;
        return Ok(None);
    }
    let (transcript, trap) = args.explain(&session, &request, args.scene.as_deref())?;
    args.page.draw(&session, &transcript)?;
    let options = RenderOptions { colour, all: args.all, summary: true, ..RenderOptions::default() };
    let filter = args.page.filter();
    if args.json {
        let json = serde_json::to_string_pretty(&transcript)
            .map_err(|error| Error::new(ErrorKind::Io, error.to_string()))?;
        output::print(format_args!("{json}\n"))?;
    } else if args.page.summary {
        output::print(render::summary(&transcript, options))?;
    } else if filter.is_empty() {
        output::print(render::text(&transcript, options))?;
    } else {
        output::print(render::parts(&transcript, &filter, options)?)?;
    }
    Ok(trap)
}

impl TraceOneRayArgs {
    /// Debugs what is requested: commands come from the terminal, or from standard input.
    #[cfg(feature = "debugger")]
    fn debug(&self, session: &Session, request: &ExplainRequest, colours: bool) -> Result<()> {
        let mut debugger = Debugger::of_scene(session, request)?;
        debugger.supply_texts(&mut |name| source_text(self.scene.as_deref(), name));
        interactive::run(debugger, colours)
    }

    /// Says that the debugger was left out.
    #[cfg(not(feature = "debugger"))]
    fn debug(&self, _: &Session, _: &ExplainRequest, _: bool) -> Result<()> {
        let message = "this build of anyhit has no debugger: it lacks the feature `debugger`";
        Err(Error::new(ErrorKind::UnsupportedTool, message).note("help: build it with `--features debugger`"))
    }

    /// The command that traces the same again.
    fn repeated(&self) -> String {
        let number = |number: Option<u32>| number.map(|number| number.to_string());
        let float = |float: Option<f32>| float.map(|float| float.to_string());
        let flags = [
            ("--pixel", self.pixel.clone()),
            ("--ray", self.ray.clone()),
            ("--pass", self.pass.clone()),
            ("--t-min", float(self.t_min)),
            ("--t-max", float(self.t_max)),
            ("--flags", self.flags.clone()),
            ("--cull-mask", number(self.cull_mask)),
            ("--time", float(self.time)),
            ("--sbt-offset", number(self.sbt_offset)),
            ("--sbt-stride", number(self.sbt_stride)),
            ("--miss-index", number(self.miss_index)),
            ("--variant", self.variant.variant.clone()),
            ("--precision", self.precision.map(|precision| precision.name().to_owned())),
        ];
        command_line("trace-one-ray", self.scene.as_deref(), &flags)
    }

    /// Loads a scene, or the one that is part of the program.
    fn load(&self, path: Option<&Path>, precision: Option<Precision>) -> Result<ResolvedScene> {
        let variant = self.variant.variant.clone();
        let options = LoadOptions { size: self.size, precision, variant, ..LoadOptions::default() };
        match path {
            Some(path) => self.files.scene(path, &options),
            None => demo::scene(&options),
        }
    }

    /// Runs a request in a scene that was loaded from a path.
    fn explain(
        &self,
        session: &Session,
        request: &ExplainRequest,
        path: Option<&Path>,
    ) -> Result<(Transcript, Option<Error>)> {
        let follow = |transcript: &Transcript| self.page.followed(transcript, self.page.compare.is_some());
        let (mut transcript, trap) =
            session.run_with_lines(request, &follow, &mut |name| source_text(path, name))?;
        if path.is_none() {
            transcript.scene = "swept-spheres (built-in)".into();
        }
        Ok((transcript, trap))
    }

    /// Where a run and another one part, as text.
    fn compare(
        &self,
        session: &Session,
        request: &ExplainRequest,
        other: Other,
        colour: bool,
    ) -> Result<String> {
        let path = self.scene.as_deref();
        let run = |session: &Session, request: &ExplainRequest, path: Option<&Path>| {
            compare::json(&self.explain(session, request, path)?.0)
        };
        let first = run(session, request, path)?;
        let load = |path: Option<&Path>, precision: Option<Precision>| {
            let mut scene = self.load(path, precision)?;
            self.limits.limits(LaunchLimits::default()).give(&mut scene);
            Session::new(scene)
        };
        let (second, name) = match other {
            Other::Pixel(pixel) => {
                let request = match &self.pass {
                    Some(pass) => ExplainRequest::InPass(pass.clone(), Box::new(pixel)),
                    None => pixel,
                };
                (run(session, &request, path)?, self.page.compare.clone().unwrap_or_default())
            }
            Other::Precision(precision) => {
                let name = format!("precision={}", precision.name());
                (run(&load(path, Some(precision))?, request, path)?, name)
            }
            Other::Scene(scene) => {
                let path = Some(Path::new(&scene));
                (run(&load(path, self.precision)?, request, path)?, scene.clone())
            }
            Other::Saved(file) => (compare::read(&file)?, file),
        };
        Ok(compare::text(&first, &second, ["this run", &name], colour))
    }

    fn request(&self) -> Result<ExplainRequest> {
        if let Some(text) = &self.pixel {
            return command::pixel(text).map(ExplainRequest::Pixel);
        }
        if let Some(text) = &self.invocation {
            let id = command::invocation(text)?;
            return Ok(ExplainRequest::Invocation { dispatch: self.dispatch.unwrap_or(0), id });
        }
        let Some(text) = &self.ray else { return Ok(ExplainRequest::Default) };
        // A name may have commas: what is not six numbers is looked up in the scene.
        let Ok(Some([origin, direction])) = command::ray(text) else {
            return Ok(ExplainRequest::Named(text.clone()));
        };
        let ray = Ray {
            origin,
            direction,
            t_min: self.t_min.unwrap_or(0.0),
            t_max: self.t_max.unwrap_or(f32::INFINITY),
        };
        let unset = GivenRay::from(ray);
        Ok(ExplainRequest::Ray(GivenRay {
            flags: self.flags.as_deref().map_or(Ok(unset.flags), command::flags)?,
            cull_mask: self.cull_mask.unwrap_or(unset.cull_mask),
            time: self.time.unwrap_or(unset.time),
            sbt_offset: self.sbt_offset.unwrap_or(unset.sbt_offset),
            sbt_stride: self.sbt_stride.unwrap_or(unset.sbt_stride),
            miss_index: self.miss_index.unwrap_or(unset.miss_index),
            ..unset
        }))
    }
}

/// The text of a source that a compiler names and no module holds: from the current folder, the
/// scene's or one above it, and for the scene that is part of the program from there alone.
fn source_text(scene: Option<&Path>, name: &str) -> Option<String> {
    let Some(scene) = scene else { return String::from_utf8(demo::FILES.read(Path::new(name)).ok()?).ok() };
    source_text::source_text(scene, name, &mut |path| DiskFiles.read(path).ok())
}

/// A whole number, decimal or with `0x` or `0b`.
fn unsigned(text: &str) -> std::result::Result<u32, String> {
    command::number(text).ok_or_else(|| "expected an integer from 0 to 4294967295".to_owned())
}
