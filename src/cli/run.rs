//! `anyhit run`: runs a scene, or the compute shader of a bare module, and prints what it left.

mod bare_module;
mod dump;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;

use crate::cli::input::{SceneFileArgs, VariantArgs, name_of};
use crate::cli::limits::LimitArgs;
use crate::cli::look::{LookArgs, LookedScene, RerunContext};
use crate::cli::many_seeds::{ManySeedsArgs, command_line};
use crate::cli::sanitize::SanitizeArgs;
use crate::cli::stability::StabilityArgs;
use crate::cli::{output, precision, stats};
use anyhit_base::atomic_file;
use anyhit_base::error::Result;
use anyhit_base::input::{InputLimit, is_stream, read_argument};
use anyhit_base::progress::Work;
use anyhit_debugger::shell;
use anyhit_engine::geometry::Precision;
use anyhit_engine::machine::{LaunchLimits, MemoryPolicy};
use anyhit_engine::pipeline::{BatchWidth, RunOptions};
use anyhit_scene::image::{PictureKind, PixelEncoding, write_picture};
use anyhit_scene::{LoadOptions, ResolvedScene};

/// Run a scene's launch and dispatches, or the compute shader of a bare module.
///
/// Texts that shaders print go to standard output. After a bare module has run, its storage buffers
/// are printed, unless --dump names others.
#[derive(Args, Clone, Debug)]
pub(super) struct RunArgs {
    /// Scene file, SPIR-V module or shader source, or `-` for a scene or module on standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    bare_module: bare_module::Arguments,
    /// Print a buffer or an image, by its name in the scene or its binding, after the run: typed
    /// (the default), hex or json; or write its bytes to a file, whose name contains a dot or a
    /// slash
    #[arg(long, value_name = "WHAT[=FORMAT|=FILE]")]
    dump: Vec<String>,
    /// Save an image, by its name in the scene or its binding, after the run: as .png, .exr
    /// (feature `exr`) or .raw (the texels' bytes)
    #[arg(long, value_name = "WHAT=FILE.png")]
    save: Vec<String>,
    /// With --save: keep the alpha of the image in a .png, which is opaque otherwise
    #[arg(long, requires = "save")]
    alpha: bool,
    /// Effect of an access outside its buffer: a trap, or Vulkan's robust result [default: the
    /// scene's value]
    #[arg(long, value_name = "POLICY", value_parser = ["trap", "robust"])]
    memory: Option<String>,
    /// Precision of a scene's intersections [default: the scene's value]
    #[arg(long, value_name = "PRECISION", value_parser = precision::parser())]
    precision: Option<Precision>,
    /// Number of lanes in a batch; results do not depend on it
    #[arg(long, value_name = "N", default_value = "64", value_parser = super::batch_widths())]
    lanes: BatchWidth,
    /// Print statistics: invocations, batches, occupancy, time, elided work
    #[arg(long)]
    stats: bool,
    #[command(flatten)]
    files: SceneFileArgs,
    #[command(flatten)]
    variant: VariantArgs,
    /// With --heat, --shadow or --perturb: print JSON
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    look: LookArgs,

    /// With --heat: heat map to write, a .png [default: heat.png]
    #[arg(
        short,
        long,
        value_name = "FILE",
        requires = "heat",
        help_heading = "Heat maps, profiles and pages"
    )]
    output: Option<PathBuf>,

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
/// Errors of the scene, the module or the arguments, and the trap that ended a shader, after the
/// requested resources are printed.
pub(super) fn run(args: RunArgs) -> Result<()> {
    args.sanitize.claim_stdout()?;
    let json = args.json && args.look.is_requested();
    checked_run(args).map_err(|error| output::json_error(json, error))
}

fn checked_run(args: RunArgs) -> Result<()> {
    check_look(&args)?;
    let begin = Instant::now();
    let (is_scene, streamed) = what(&args)?;
    let scene = match is_scene {
        true => {
            args.bare_module.check_unused()?;
            let options = LoadOptions {
                precision: args.precision,
                variant: args.variant.variant.clone(),
                only_shaders_trace: true,
                ..LoadOptions::default()
            };
            // `--dump` and `--save` need resources that no shader declares.
            let files = args.files.reading_all(!args.dump.is_empty() || !args.save.is_empty());
            match streamed {
                None => files.scene(&args.file, &options)?,
                Some(bytes) => {
                    anyhit_scene::load_bytes(&name_of(&args.file), bytes, &files.files()?, &options)?
                }
            }
        }
        false if args.precision.is_some() => {
            return Err(dump::invalid(
                "`--precision` requires a scene: a bare module has no geometry".into(),
            ));
        }
        false if args.variant.variant.is_some() => {
            return Err(dump::invalid("`--variant` requires a scene: a bare module has no variants".into()));
        }
        false => {
            let (scene, command_line) =
                args.bare_module.scene(&args.file, streamed, args.files.limits(), args.files.strict())?;
            return run_scene(&args, scene, false, begin).map_err(|error| command_line.reported(error));
        }
    };
    run_scene(&args, scene, true, begin)
}

/// Refuses what cannot be combined with `--heat`, `--profile` and `--html`, before anything is
/// read.
fn check_look(args: &RunArgs) -> Result<()> {
    args.look.check(args.output.as_deref(), args.json)?;
    if !args.look.is_requested() {
        return Ok(());
    }
    args.look.check_alone(&[
        (args.sanitize.is_requested(), "the sanitizer"),
        (args.many_seeds.is_requested(&args.stability), "`--many-seeds`"),
        (args.stability.is_requested(), "`--shadow` or `--perturb`"),
        (args.stats, "`--stats`"),
        (!args.dump.is_empty() || !args.save.is_empty(), "`--dump` or `--save`"),
    ])
}

/// Counts what a launch or dispatch costs, as `--heat`, `--profile` and `--html` ask for.
fn run_look(args: &RunArgs, scene: ResolvedScene, is_scene: bool) -> Result<()> {
    let mut flags = String::new();
    if let Some(precision) = args.precision {
        flags += &format!(" --precision {}", precision.name());
    }
    if let Some(variant) = &args.variant.variant {
        flags += &format!(" --variant {}", shell::word(variant));
    }
    let context = RerunContext {
        scene: match is_scene && args.memory.is_none() {
            true => LookedScene::File(&args.file),
            false => LookedScene::Unnamed,
        },
        flags: &flags,
        output: args.output.as_deref(),
        json: args.json,
        keep_alpha: args.alpha,
    };
    args.look.run(scene, context)
}

fn memory_policy(name: &str) -> MemoryPolicy {
    if name == "robust" { MemoryPolicy::Robust } else { MemoryPolicy::Trap }
}

/// Runs a scene, or the one that was made for a bare module.
fn run_scene(args: &RunArgs, mut scene: ResolvedScene, is_scene: bool, begin: Instant) -> Result<()> {
    output::notes(&scene.notes);
    args.limits.limits(LaunchLimits::default()).give(&mut scene);
    if let Some(memory) = args.memory.as_deref() {
        scene.memory = memory_policy(memory);
    }
    if args.look.is_requested() {
        return run_look(args, scene, is_scene);
    }
    let mut assembled = anyhit_scene::assemble(&scene)?;
    output::notes(&assembled.notes);
    if args.stability.is_requested() {
        return args.stability.run(&scene, &assembled, None, args.json, args.many_seeds.perturbed_runs());
    }
    if args.json {
        let message =
            "`--json` requires --heat, --shadow or --perturb; `--dump WHAT=json` prints a buffer as JSON";
        return Err(dump::invalid(message.to_owned()));
    }
    let printed = Arc::default();
    assembled.resources.printed = Some(Arc::clone(&printed));
    let mut shown: Vec<_> = args.dump.iter().map(|text| dump::Dump::parse(text)).collect::<Result<_>>()?;
    if !is_scene && shown.is_empty() && args.save.is_empty() {
        shown = dump::Dump::storage_buffers(&assembled, &scene);
    }
    let shown: Vec<_> =
        shown.iter().map(|one| one.find(&scene, &assembled.resources)).collect::<Result<_>>()?;
    let saved = args.save.iter().map(|text| saved_image(text, &scene, &assembled.resources, args.alpha));
    let saved: Vec<_> = saved.collect::<Result<_>>()?;

    let load_time = begin.elapsed();
    let drawn = args.many_seeds.run(&args.sanitize, &args.stability, &scene, &assembled, repeated(args))?;
    let launched = Instant::now();
    let sanitized = match args.sanitize.is_requested() {
        true => Some(args.sanitize.run(&scene, &assembled, &assembled.resources)?),
        false => None,
    };
    let (found, outcome) = match sanitized {
        Some(run) => (Some(run.findings), run.outcome),
        None => {
            let work = Work::counted("running", assembled.invocations());
            let on_progress = |count| work.advance(count);
            let options = RunOptions::of(args.lanes).on_progress(&on_progress);
            (None, assembled.run(&assembled.resources, options))
        }
    };
    let launch_time = launched.elapsed();
    let has_output = args.stats || !shown.is_empty() || !saved.is_empty();
    if !output::printed(&printed)? && !has_output && outcome.is_ok() {
        output::hint(dump::hint(&scene));
    }
    for one in shown {
        match one.file() {
            Some(path) => atomic_file::write(path, one.bytes())?,
            None => output::print(one.text(&assembled)?)?,
        }
    }
    for (path, image, encoding) in saved {
        write_picture(&path, &image, encoding)?;
    }
    let launch_stats = args.sanitize.finish([found, drawn], outcome, &scene.path)?;
    if args.stats {
        output::print(stats::table(&launch_stats, load_time, launch_time))?;
        output::print(stats::elided(&launch_stats, &assembled))?;
        output::print(stats::single_threaded(&assembled))?;
        output::print(stats::unread(&scene, &assembled))?;
    }
    Ok(())
}

/// The command that runs the same again, as far as the values of buffers and images depend on it.
fn repeated(args: &RunArgs) -> String {
    let mut flags = args.bare_module.flags();
    flags.push(("--variant", args.variant.variant.clone()));
    flags.push(("--memory", args.memory.clone()));
    flags.push(("--precision", args.precision.map(|precision| precision.name().to_owned())));
    command_line("run", Some(&args.file), &flags)
}

/// Whether the file is a scene, and its bytes where they were read to tell: a pipe has no name that
/// says it, and can be read once.
fn what(args: &RunArgs) -> Result<(bool, Option<Vec<u8>>)> {
    let extension = args.file.extension();
    if extension.is_some_and(|extension| extension == "toml") {
        return Ok((true, None));
    }
    if extension.is_some() || !is_stream(&args.file) {
        return Ok((false, None));
    }
    let bytes = read_argument(&args.file, InputLimit::ModuleBytes, &args.files.limits())?;
    let is_scene = std::str::from_utf8(&bytes).is_ok_and(|text| !text.contains('\0'));
    Ok((is_scene, Some(bytes)))
}

type SavedImage = (PathBuf, Arc<anyhit_engine::machine::image::Image>, PixelEncoding);

/// `WHAT=FILE.png`: the file, the image and the encoding of a PNG.
fn saved_image(
    text: &str,
    scene: &ResolvedScene,
    resources: &anyhit_engine::machine::Resources,
    keep_alpha: bool,
) -> Result<SavedImage> {
    let Some((what, path)) = text.split_once('=') else {
        return Err(dump::invalid(format!("`--save {text}` is not WHAT=FILE.png")));
    };
    let (at, element, found) = dump::descriptor(what, scene, resources)?;
    let bound = scene.resources.iter();
    let bound = bound.filter(|one| (one.set, one.binding, one.element) == (at.set, at.binding, element));
    let mut encoding = bound.map(|one| scene.encoding_of(one)).next().unwrap_or_default();
    encoding.keep_alpha |= keep_alpha;
    match found {
        dump::FoundResource::Image(image) => match output::picture_file(path.into()) {
            Ok(path) => {
                PictureKind::of(&path).map_or(Ok(()), PictureKind::check)?;
                Ok((path, image, encoding))
            }
            Err(why) => Err(dump::invalid(format!("`--save {text}`: {why}"))),
        },
        dump::FoundResource::Buffer(_) => {
            Err(dump::invalid(format!("`--save {text}`: the resource is not an image")))
        }
    }
}
