//! `anyhit render`: launches a scene's ray generation shader over its image.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::stability::StabilityArgs;
use crate::cli::{output, precision, stats};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Precision;
use crate::harness::stability::apart;
use crate::machine::Binding;
use crate::scene::image::write_png;
use crate::scene::resources::Output;
use crate::scene::{self, DiskFiles, Options};

/// Renders a scene: launches its ray generation shader over an image and saves the image.
#[derive(Debug, clap::Args)]
pub struct RenderArgs {
    /// The scene file (`scene.toml`); the built-in swept-spheres demo without it.
    scene: Option<PathBuf>,

    /// Where to write the picture, a PNG.
    #[arg(short, long, value_name = "FILE", default_value = "out.png")]
    output: PathBuf,

    /// Width and height of the launch, instead of the scene's own.
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,

    /// Lanes that run together; the picture does not depend on it.
    #[arg(long, value_name = "N", default_value = "64", value_parser = ["1", "8", "64"])]
    lanes: String,

    /// How hits are computed, instead of the scene's own choice; only `exact` is right on every ray
    #[arg(long, value_name = "PRECISION", value_parser = precision::parser())]
    precision: Option<Precision>,

    /// Prints what was done: rays, invocations, occupancy, time.
    #[arg(long)]
    stats: bool,

    #[command(flatten)]
    stability: StabilityArgs,

    /// With --shadow or --perturb: print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Of the scene, of a shader that traps, or of writing the picture; `Expectation` where `--perturb`
/// finds that an output is not stable, after all is written and printed.
pub fn run(args: RenderArgs) -> Result<()> {
    if args.json && !args.stability.asks() {
        let message = "`--json` is for --shadow and --perturb";
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    let options = Options { size: args.size, precision: args.precision, ..Options::default() };
    let begin = Instant::now();
    let resolved = match &args.scene {
        Some(path) => scene::load(path, &DiskFiles, &options)?,
        None => scene::demo::scene(&options)?,
    };
    let Some(output) = resolved.output() else {
        let message = "the scene has no output image: give one storage image `output = true`";
        return Err(Error::new(ErrorKind::InvalidScene, message).at(crate::error::Place::File(resolved.path)));
    };
    let binding = Binding { set: output.set, binding: output.binding };
    let linear = output.output == Some(Output::Linear);
    let mut assembled = scene::assemble(&resolved)?;
    let stability = args.stability.asks().then(|| apart(&assembled));
    let printed = Arc::default();
    assembled.resources.printed = Some(Arc::clone(&printed));
    let ready = begin.elapsed();

    let count = assembled.size.iter().map(|&side| u64::from(side)).product();
    let bar = progress(count);
    let launched = Instant::now();
    let launch = assembled.launch();
    let done = |count| bar.inc(count);
    let outcome = match args.lanes.as_str() {
        "1" => launch.run::<1>(assembled.size, &done),
        "8" => launch.run::<8>(assembled.size, &done),
        _ => launch.run::<64>(assembled.size, &done),
    };
    bar.finish_and_clear();
    let traced = launched.elapsed();
    output::printed(&printed)?;
    let counted = outcome?;

    let image = assembled.resources.image(binding.set, binding.binding);
    let image = image.expect("bug in anyhit: the output image is not bound");
    write_png(&args.output, image, linear)?;
    if args.stats {
        output::print(stats::table(&counted, ready, traced))?;
        output::print(stats::spared(&counted, &assembled))?;
        output::print(stats::order(&assembled))?;
    }
    if let Some(before) = stability {
        args.stability.run(&resolved, &before, None, args.json)?;
    }
    Ok(())
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides =
        text.split_once(['x', 'X']).map(|(width, height)| (width.trim().parse(), height.trim().parse()));
    match sides {
        Some((Ok(width), Ok(height))) if width > 0 && height > 0 => Ok([width, height]),
        _ => Err(format!("`{text}` is not WIDTHxHEIGHT, such as 640x360")),
    }
}

/// A bar that appears where standard error is a terminal and the work takes a while.
fn progress(count: u64) -> ProgressBar {
    let bar = ProgressBar::new(count);
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {elapsed_precise}  about {eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
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
