//! Streams the output image of a launch: bands of its rows are rendered, handed out and freed one
//! after the other, so that the whole image is never in memory.
//!
//! This requires that every invocation accesses only one row of the image: the row of its launch
//! index, or the same row counted from the bottom, as
//! [`race_analysis`](crate::program::race_analysis) finds out. A band is a range of the launch's
//! order that begins where a batch, a tile and a subgroup begin. So batches, schedule and counts
//! are those of the whole launch, and the results are equal bit for bit.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use crate::machine::format::Format;
use crate::machine::image::{Image, Position};
use crate::machine::{Binding, Descriptor};
use crate::math::array;
use crate::module::interface::Stage;
use crate::pipeline::launch::Launch;
use crate::pipeline::order;
use crate::pipeline::run_options::RunOptions;
use crate::pipeline::stats::Stats;
use crate::program::Program;
use crate::program::race_analysis::{LaunchExtent, OwnRow};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::threads::has_threads;

/// The widest batch, and the largest subgroup.
const MAX_BATCH_WIDTH: u32 = 128;

/// An output image that is handed out in bands of rows while a launch renders it: a 2D image as
/// wide and high as the launch, which the launch itself binds.
#[derive(Clone, Debug, PartialEq, Eq)]
#[must_use]
pub struct StreamedImage {
    /// The image's binding: the first array element of a storage image.
    #[doc(hidden)]
    pub binding: Binding,
    /// The texel format.
    pub format: Format,
    /// The initial bytes of every texel.
    pub texel: Vec<u8>,
    /// The most bytes of a band. A band has at least the rows that hold a whole number of batches:
    /// 8 where 16 divides the width, 128 where the width is odd. Two bands are in memory at a time.
    pub band_bytes: u64,
}

impl StreamedImage {
    /// An image of zeros, in bands of 32 MiB.
    #[must_use]
    pub fn new(set: u32, binding: u32, format: Format) -> Self {
        let texel = vec![0; format.texel_size() as usize];
        Self { binding: Binding { set, binding }, format, texel, band_bytes: 32 << 20 }
    }
}

/// Why an image cannot be streamed in bands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotStreamed {
    /// The launch is deeper than 1, so that it writes every row several times.
    Depth(u32),
    /// A shader may access another row than that of its launch index, as far as the analysis knows.
    CrossesRows {
        /// The shader's stage.
        stage: Stage,
        /// The shader's entry point.
        name: String,
    },
    /// Rows are mirrored, so that a launch from the image's top row starts at its last launch
    /// index, and invocations depend on the launch order.
    Order,
}

impl fmt::Display for NotStreamed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Depth(depth) => {
                write!(f, "the launch has a depth of {depth} and writes the image that many times")
            }
            Self::CrossesRows { stage, name } => write!(
                f,
                "{} `{name}` may access texels in rows other than that of its own launch index",
                stage.name()
            ),
            Self::Order => f.write_str(
                "rows are filled from the last to the first, but invocations depend on their order, \
                 first to last",
            ),
        }
    }
}

impl std::error::Error for NotStreamed {}

/// Consecutive rows of an image, rendered.
#[derive(Clone, Copy, Debug)]
pub struct Band<'a> {
    image: &'a Image,
}

impl Band<'_> {
    /// The texel format.
    #[must_use]
    pub fn format(&self) -> Format {
        self.image.format()
    }

    /// Width and height of the whole image.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        let [width, height, _] = self.image.shape().extent;
        [width, height]
    }

    /// The rows of the band, counted from the top of the whole image.
    #[must_use]
    pub fn rows(&self) -> Range<u32> {
        self.image.rows()
    }

    /// The bytes of one of the band's rows, texel by texel from the left.
    ///
    /// # Errors
    /// `InvalidArgument` for a row that is not in the band.
    pub fn row_bytes(&self, row: u32) -> Result<Vec<u8>> {
        let rows = self.rows();
        if !rows.contains(&row) {
            let message = format!("row {row} is not within {} to {}", rows.start, rows.end);
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        Ok(self.image.row_bytes(row))
    }

    /// R, G, B and A of the texel at a position in the whole image, as a shader reads them;
    /// integers as numbers. Components that the format lacks are 0, and A is 1. Of 64-bit integers
    /// those up to 2^53 are exact; [`Band::row_bytes`] has them all.
    ///
    /// # Errors
    /// `InvalidArgument` for a texel that is not in the band.
    pub fn at(&self, x: u32, y: u32) -> Result<[f64; 4]> {
        let position = Position { at: [x.into(), y.into(), 0], ..Position::default() };
        let rows = self.rows();
        let index = self.image.index(&position).ok_or_else(|| {
            let message = format!("no texel ({x}, {y}) in rows {} to {}", rows.start, rows.end);
            Error::new(ErrorKind::InvalidArgument, message)
        })?;
        Ok(self.image.format().decode_numbers(self.image.load(index)))
    }
}

/// A launch that runs band by band.
#[derive(Clone, Debug)]
pub struct BandedLaunch<'a> {
    launch: Launch<'a>,
    size: [u32; 2],
    image: &'a StreamedImage,
    row: OwnRow,
    /// The number of rows of every band but the last, which may have fewer.
    band_rows: u32,
    /// The first band that is run, counted from the top, and the step to the next one.
    first: u32,
    step: u32,
}

impl<'a> Launch<'a> {
    /// Splits the launch into bands of an image's rows, if the results are equal to those of the
    /// launch as a whole.
    ///
    /// # Errors
    /// Why they may differ.
    pub fn bands(
        &self,
        size: [u32; 3],
        image: &'a StreamedImage,
    ) -> std::result::Result<BandedLaunch<'a>, NotStreamed> {
        let [width, height, depth] = size;
        if depth > 1 {
            return Err(NotStreamed::Depth(depth));
        }
        let programs: Vec<&Program> = self.pipeline.programs.iter().map(|program| &**program).collect();
        let extent = LaunchExtent { count: size, local: [1; 3], resources: self.resources };
        let row = extent.own_row(&programs, image.binding).map_err(|program| NotStreamed::CrossesRows {
            stage: program.stage,
            name: program.name.clone(),
        })?;
        let ordered = || self.pipeline.order_dependent() || extent.shared(&programs).is_some();
        if row == OwnRow::Mirrored && ordered() {
            return Err(NotStreamed::Order);
        }
        // Both are powers of two: their least common multiple is the larger one.
        let whole_batches = MAX_BATCH_WIDTH >> width.trailing_zeros().min(MAX_BATCH_WIDTH.ilog2());
        let unit = order::TILE_SIDE.max(u64::from(whole_batches));
        let row_bytes = u64::from(width) * u64::from(image.format.texel_size());
        let band_rows = (image.band_bytes / row_bytes.max(1) / unit * unit).max(unit);
        let band_rows = u32::try_from(band_rows).unwrap_or(u32::MAX / MAX_BATCH_WIDTH * MAX_BATCH_WIDTH);
        Ok(BandedLaunch {
            launch: self.clone(),
            size: [width, height],
            image,
            row,
            band_rows,
            first: 0,
            step: 1,
        })
    }
}

impl BandedLaunch<'_> {
    /// Runs every `step`th band alone, from the band `first` on, counted from the image's top. What
    /// bands write besides the image is then of these alone.
    #[must_use]
    pub fn every(self, first: u32, step: u32) -> Self {
        Self { first, step, ..self }
    }

    /// The number of bands.
    pub fn count(&self) -> u32 {
        self.size[1].div_ceil(self.band_rows)
    }

    /// The greatest number of rows of a band.
    pub fn max_band_rows(&self) -> u32 {
        self.band_rows.min(self.size[1])
    }

    /// Runs the launch. Each band is passed to `sink` when it is rendered, from the image's top to
    /// its bottom, while the next one is being rendered.
    ///
    /// # Errors
    /// The trap of the lowest launch index, or the error that `sink` returns. Later bands are not
    /// passed on, and their invocations may not have run.
    pub fn run(
        &self,
        options: RunOptions<'_>,
        sink: &mut (dyn FnMut(Band<'_>) -> Result<()> + Send),
    ) -> Result<Stats> {
        let [width, height] = self.size;
        let dog = self.launch.watchdog_of(self.launch.invocation_count([width, height, 1])?, options);
        let mut tasks = 0;
        let mut stats = Stats::default();
        let mut rendered: Option<Arc<Image>> = None;
        // The trap of the last band that trapped: if rows are mirrored, later bands have lower
        // launch indices.
        let mut trapped = None;
        for number in (self.first..self.count()).step_by(self.step as usize) {
            let at = if self.row == OwnRow::Same { number } else { self.count() - 1 - number };
            let launched = at * self.band_rows..height.min((at + 1).saturating_mul(self.band_rows));
            let rows = match self.row {
                OwnRow::Same => launched.clone(),
                OwnRow::Mirrored => height - launched.end..height - launched.start,
            };
            let image = Image::band(width, height, rows, self.image.format, &self.image.texel)?;
            let mut resources = self.launch.resources.clone();
            resources.insert(self.image.binding, 0, Descriptor::Image(image.clone()));
            let mut run = || {
                let launch = Launch { pipeline: self.launch.pipeline, resources: &resources };
                let positions =
                    array::map([launched.start, launched.end], |row| u64::from(row) * u64::from(width));
                launch.run_positions(
                    [width, height, 1],
                    positions[0]..positions[1],
                    &dog,
                    &mut tasks,
                    options,
                )
            };
            let (emitted, outcome) = match rendered.take() {
                None => (Ok(()), run()),
                Some(before) if has_threads() => rayon::join(|| sink(Band { image: &before }), run),
                Some(before) => (sink(Band { image: &before }), run()),
            };
            emitted?;
            match outcome {
                Ok(more) => stats = stats.plus(&more),
                Err(error) if self.row == OwnRow::Same => return Err(error),
                Err(error) => trapped = Some(error),
            }
            if trapped.is_none() {
                rendered = Some(image);
            }
        }
        if let Some(error) = trapped {
            return Err(error);
        }
        rendered.map_or(Ok(()), |last| sink(Band { image: &last }))?;
        Ok(stats)
    }

    /// The error for an image that cannot be streamed.
    pub fn cannot_stream(image: &StreamedImage, why: &NotStreamed) -> Error {
        let Binding { set, binding } = image.binding;
        let message =
            format!("the image at set {set}, binding {binding} cannot be processed in bands: {why}");
        Error::new(ErrorKind::InvalidArgument, message)
    }
}
