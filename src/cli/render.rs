//! `anyhit render`: runs a scene and saves its picture.

mod share;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use crate::cli::input::{SceneFileArgs, VariantArgs};
use crate::cli::limits::LimitArgs;
use crate::cli::look::{LookArgs, LookedScene, RerunContext};
use crate::cli::many_seeds::{ManySeedsArgs, command_line};
use crate::cli::render::share::PictureShare;
use crate::cli::sanitize::SanitizeArgs;
use crate::cli::share::ShareArgs;
use crate::cli::stability::StabilityArgs;
use crate::cli::{output, precision, stats};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::progress::Work;
use anyhit_cases::shares::render::RenderWhole;
use anyhit_cases::stability::deep_copy;
use anyhit_debugger::shell;
use anyhit_engine::geometry::Precision;
use anyhit_engine::machine::LaunchLimits;
use anyhit_engine::machine::image::ImageShape;
use anyhit_engine::pipeline::{BandedLaunch, BatchWidth, RunOptions, Stats, StreamedImage};
use anyhit_scene::image::{PictureKind, stream_png, write_picture};
use anyhit_scene::image_entry::ImageContent;
use anyhit_scene::resources::Resource;
use anyhit_scene::{Assembled, LoadOptions, ResolvedScene, resolved};

/// Render a scene to a picture.
///
/// Runs the scene's launch, dispatches or passes and saves the output image. An image of more than
/// 64 MiB is written in bands of rows while it is rendered, if every invocation writes only to the
/// row of its own launch index. Any other image is kept in memory, up to 1 GiB.
#[derive(Debug, clap::Args)]
pub(super) struct RenderArgs {
    /// Scene file (`scene.toml`), or `-` for standard input [default: the built-in swept-spheres
    /// demo]
    scene: Option<PathBuf>,

    /// File to write, .png, .exr (feature `exr`) or .raw (the texels' bytes) [default: out.png]
    #[arg(short, long, value_name = "FILE", value_parser = output::picture_parser())]
    output: Option<PathBuf>,

    /// Keep the alpha of the image in a .png, which is opaque otherwise
    #[arg(long)]
    alpha: bool,

    /// Width and height of the launch, instead of the scene's own; up to 2^30 texels, such as
    /// 32768x32768
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,

    /// Number of lanes in a batch; the picture does not depend on it
    #[arg(long, value_name = "N", default_value = "64", value_parser = super::batch_widths())]
    lanes: BatchWidth,

    /// Precision of intersections, instead of the scene's own; only `exact` is correct for every
    /// ray
    #[arg(long, value_name = "PRECISION", value_parser = precision::parser())]
    precision: Option<Precision>,

    /// Print statistics: rays, invocations, occupancy, time, elided work
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

    #[command(flatten)]
    stability: StabilityArgs,

    #[command(flatten)]
    sanitize: SanitizeArgs,

    #[command(flatten)]
    many_seeds: ManySeedsArgs,

    #[command(flatten)]
    share: ShareArgs,

    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// Errors of the scene, of a shader that traps, or of writing the image; `Expectation` if
/// `--perturb` finds that an output is not stable, after everything is written and printed.
pub(super) fn run(args: RenderArgs) -> Result<()> {
    args.sanitize.claim_stdout()?;
    let json = args.json && args.look.is_requested();
    if args.look.is_requested() {
        return run_look(args).map_err(|error| output::json_error(json, error));
    }
    args.look.check(None, args.json)?;
    check_share(&args)?;
    if args.json && !args.stability.is_requested() {
        let message = "`--json` requires --heat, --shadow or --perturb";
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    if let Some(kind) = args.output.as_deref().and_then(PictureKind::of) {
        kind.check()?;
    }
    let begin = Instant::now();
    let file = args.output.clone().unwrap_or_else(|| PathBuf::from("out.png"));
    let resolved = load(&args, true)?;
    let Some((output, image)) = output_image(&resolved) else {
        let message = "the scene has no output image";
        return Err(Error::new(ErrorKind::InvalidScene, message)
            .at(Place::File(resolved.path))
            .note("help: set `output = true` on one storage image"));
    };
    let mut encoding = resolved.encoding_of(output);
    encoding.keep_alpha |= args.alpha;
    let mut assembled = anyhit_scene::assemble_without(&resolved, output)?;
    output::notes(&assembled.notes);
    let streamed = StreamedImage {
        texel: image.texels.bytes()?.into_owned(),
        ..StreamedImage::new(output.set, output.binding, image.format)
    };
    let printed = Arc::default();
    assembled.resources.printed = Some(Arc::clone(&printed));
    if args.share.is_requested() {
        // The smallest bands, so that shares take equally long.
        let streamed = StreamedImage { band_bytes: 0, ..streamed };
        let bands = shared_bands(&args, &resolved, &assembled, output, &streamed)?;
        let [width, height, _] = assembled.size;
        let whole = RenderWhole {
            scene: escape::path(&resolved.path).to_string(),
            variant: args.variant.variant.clone(),
            precision: args.precision.map(|precision| precision.name().to_owned()),
            size: [width, height],
            format: RenderWhole::format_of(image.format),
            to_srgb: encoding.to_srgb,
            keep_alpha: encoding.keep_alpha,
        };
        let pixels = u64::from(width) * u64::from(height);
        let work = Work::counted("rendering", pixels / args.share.shard_or_whole().of as u64);
        let shared = PictureShare { share: &args.share, whole, bands };
        let outcome = shared.run(RunOptions::of(args.lanes).on_progress(&|count| work.advance(count)));
        drop(work);
        output::printed(&printed)?;
        return outcome;
    }
    let (bands, whole_image) = match split_into_bands(&args, &resolved, &assembled, output, &streamed) {
        Ok(bands) => (Some(bands), None),
        Err(why) => {
            let with_reason = |error: Error| {
                error.at(output.place.clone()).note(format!("the whole image is held in memory: {why}"))
            };
            let image = anyhit_scene::assemble::image(image, &resolved.files.limits).map_err(with_reason)?;
            anyhit_scene::assemble::bind_image(&resolved, output, &image, &mut assembled.resources);
            (None, Some(image))
        }
    };
    let stability = args.stability.is_requested().then(|| deep_copy(&assembled));
    let load_time = begin.elapsed();

    let size = assembled.size;
    let is_single_launch = assembled.is_single_launch();
    let drawn =
        args.many_seeds.run(&args.sanitize, &args.stability, &resolved, &assembled, repeated(&args))?;
    let launched = Instant::now();
    let launch = assembled.launch();
    let sanitized = match args.sanitize.is_requested() {
        true => Some(args.sanitize.run(&resolved, &assembled, &assembled.resources)?),
        false => None,
    };
    let invocations = match is_single_launch {
        true => size.iter().map(|&side| u64::from(side)).product(),
        false => assembled.invocations(),
    };
    let work = Work::counted("rendering", invocations);
    let on_progress = |count| work.advance(count);
    let options = RunOptions::of(args.lanes).on_progress(&on_progress);
    let outcome = match &bands {
        _ if sanitized.is_some() => Ok(Stats::default()),
        None if !is_single_launch => assembled.run(&assembled.resources, options),
        None => launch.run(size, options),
        Some(bands) => stream_png(&file, [size[0], size[1]], image.format, encoding, |png| {
            bands.run(options, &mut |band| png.rows(band.rows(), |row| band.row_bytes(row)))
        }),
    };
    drop(work);
    let launch_time = launched.elapsed();
    output::printed(&printed)?;
    let launch_stats = outcome?;

    if let Some(image) = &whole_image {
        write_picture(&file, image, encoding)?;
    }
    if let Some(run) = sanitized {
        return args.sanitize.finish([Some(run.findings), drawn], run.outcome, &resolved.path).map(|_| ());
    }
    if drawn.is_some() {
        return args.sanitize.finish([None, drawn], Ok(launch_stats), &resolved.path).map(|_| ());
    }
    if args.output.is_none() {
        output::hint(format_args!("the picture is in {}", escape::path(&file)));
    }
    if args.stats {
        output::print(stats::table(&launch_stats, load_time, launch_time))?;
        output::print(stats::elided(&launch_stats, &assembled))?;
        output::print(stats::single_threaded(&assembled))?;
        output::print(stats::unread(&resolved, &assembled))?;
        output::print(bands.as_ref().map_or_else(String::new, |bands| stats::bands(bands, image)))?;
    }
    if let Some(initial) = stability {
        args.stability.run(&resolved, &initial, None, args.json, args.many_seeds.perturbed_runs())?;
    }
    Ok(())
}

/// The command that renders the same again.
fn repeated(args: &RenderArgs) -> String {
    let size = args.size.map(|[width, height]| format!("{width}x{height}"));
    let precision = args.precision.map(|precision| precision.name().to_owned());
    let flags = [("--size", size), ("--variant", args.variant.variant.clone()), ("--precision", precision)];
    command_line("render", args.scene.as_deref(), &flags)
}

/// Refuses what a share of a picture cannot do.
fn check_share(args: &RenderArgs) -> Result<()> {
    if !args.share.is_requested() {
        return Ok(());
    }
    let message = if !args.share.has_result() {
        "`--shard` requires `--result FILE`: a shard writes no picture"
    } else if args.output.is_some() {
        "`--result` writes no picture: `anyhit merge FILE... -o PICTURE` writes the picture of all shards"
    } else if args.stats {
        "`--stats` requires a whole launch, and `--result` writes a shard of one"
    } else {
        return Ok(());
    };
    Err(Error::new(ErrorKind::InvalidArgument, message))
}

/// The bands of a launch, of which each can be run by itself.
///
/// # Errors
/// Why they cannot.
fn shared_bands<'a>(
    args: &RenderArgs,
    scene: &ResolvedScene,
    assembled: &'a Assembled,
    output: &resolved::ResolvedBinding,
    streamed: &'a StreamedImage,
) -> Result<BandedLaunch<'a>> {
    let pipeline = &assembled.pipeline;
    let bands = if let Some(reason) = why_not_in_bands(args, scene, assembled, output) {
        Err(reason.to_owned())
    } else if pipeline.order_dependent() {
        Err("shaders depend on the order of invocations".to_owned())
    } else if pipeline.shared_memory(assembled.size, &assembled.resources).is_some() {
        Err("invocations read data that others write".to_owned())
    } else {
        assembled.launch().bands(assembled.size, streamed).map_err(|why| why.to_string())
    };
    bands.map_err(|why| {
        let message = format!("the picture cannot be divided into shards of rows: {why}");
        Error::new(ErrorKind::InvalidArgument, message).at(output.place.clone())
    })
}

/// Counts what a launch or dispatch costs, as `--heat`, `--profile` and `--html` ask for.
fn run_look(args: RenderArgs) -> Result<()> {
    let look = &args.look;
    look.check_alone(&[
        (args.sanitize.is_requested(), "the sanitizer"),
        (args.many_seeds.is_requested(&args.stability), "`--many-seeds`"),
        (args.stability.is_requested(), "`--shadow` or `--perturb`"),
        (args.stats, "`--stats`"),
        (args.share.is_requested(), "`--shard` or `--result`"),
    ])?;
    look.check(args.output.as_deref(), args.json)?;
    if let Some(kind) = args.output.as_deref().and_then(PictureKind::of) {
        kind.check()?;
    }
    let scene = load(&args, false)?;
    let mut flags = String::new();
    if let Some([width, height]) = args.size {
        flags += &format!(" --size {width}x{height}");
    }
    if let Some(precision) = args.precision {
        flags += &format!(" --precision {}", precision.name());
    }
    if let Some(variant) = &args.variant.variant {
        flags += &format!(" --variant {}", shell::word(variant));
    }
    look.run(
        scene,
        RerunContext {
            scene: args.scene.as_deref().map_or(LookedScene::Demo, LookedScene::File),
            flags: &flags,
            output: args.output.as_deref(),
            json: args.json,
            keep_alpha: args.alpha,
        },
    )
}

/// Loads the scene to render, with its limits; `streams` as in [`LoadOptions`].
fn load(args: &RenderArgs, streams: bool) -> Result<ResolvedScene> {
    let options = LoadOptions {
        size: args.size,
        precision: args.precision,
        streams,
        variant: args.variant.variant.clone(),
        only_shaders_trace: true,
    };
    let mut scene = match &args.scene {
        Some(path) => args.files.scene(path, &options)?,
        None => crate::demo::scene(&options)?,
    };
    output::notes(&scene.notes);
    args.limits.limits(LaunchLimits::default()).give(&mut scene);
    Ok(scene)
}

/// The storage image with the scene's key `output`, which is saved.
fn output_image(scene: &ResolvedScene) -> Option<(&resolved::ResolvedBinding, &ImageContent)> {
    let output = scene.output()?;
    match &output.resource {
        Resource::StorageImage(image) => Some((output, &**image)),
        _ => None,
    }
}

/// Splits the launch into bands of the output image. The error says why the whole image must be in
/// memory.
fn split_into_bands<'a>(
    args: &RenderArgs,
    scene: &ResolvedScene,
    assembled: &'a Assembled,
    output: &resolved::ResolvedBinding,
    streamed: &'a StreamedImage,
) -> Result<BandedLaunch<'a>, String> {
    let kind = args.output.as_deref().and_then(PictureKind::of).unwrap_or(PictureKind::Png);
    let takes_little = |image: &Arc<ImageContent>| image.size() <= 2 * streamed.band_bytes;
    let reason = if kind != PictureKind::Png {
        "only a PNG is written in bands"
    } else if let Some(reason) = why_not_in_bands(args, scene, assembled, output) {
        reason
    } else if output.resource.image().is_some_and(takes_little) {
        "it needs no more memory than two bands"
    } else {
        return assembled.launch().bands(assembled.size, streamed).map_err(|why| why.to_string());
    };
    Err(reason.to_owned())
}

/// Why a launch does not draw its image in bands, whatever its shaders do; `None` where it may.
fn why_not_in_bands(
    args: &RenderArgs,
    scene: &ResolvedScene,
    assembled: &Assembled,
    output: &resolved::ResolvedBinding,
) -> Option<&'static str> {
    let Some(image) = output.resource.image() else { return Some("the output is not an image") };
    let [width, height, _] = assembled.size;
    Some(if !assembled.is_single_launch() {
        "the scene runs more than one launch"
    } else if args.sanitize.is_requested() {
        "the sanitizer runs the whole launch"
    } else if args.many_seeds.is_requested(&args.stability) {
        "--many-seeds runs the launch several times"
    } else if args.stability.is_requested() {
        "--shadow and --perturb run the launch several times"
    } else if image.shape != ImageShape::plane(width, height) {
        "it is not a 2D image of the launch's size with one level and one sample"
    } else if !image.texels.are_equal(image.format) {
        "the scene sets its texels individually"
    } else if scene.bindings_of_image(output).count() > 1 {
        "it has several bindings"
    } else if output.kept_at().is_heap() {
        "it lies in a descriptor heap"
    } else if output.element > 0 {
        "it is not the first of an array of images"
    } else {
        return None;
    })
}

/// Width and height, such as `640x360`.
pub(super) fn size(text: &str) -> Result<[u32; 2], String> {
    let sides =
        text.split_once(['x', 'X']).map(|(width, height)| (width.trim().parse(), height.trim().parse()));
    match sides {
        Some((Ok(width), Ok(height))) if width > 0 && height > 0 => Ok([width, height]),
        _ => Err(format!("`{text}` is not WIDTHxHEIGHT, such as 640x360")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_or_refused() {
        assert_eq!(size("640x360"), Ok([640, 360]));
        assert_eq!(size("8X1"), Ok([8, 1]));
        for wrong in ["", "640", "0x5", "-1x5", "axb", "1x2x3"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}
