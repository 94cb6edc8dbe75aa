//! Launches whose image is never there as a whole: band after band of its rows is filled, handed
//! out and forgotten.
//!
//! That can be done where every invocation keeps to one row of the image, that of its launch index
//! or the same counted from the other end ([`race_analysis`](crate::program::race_analysis)). A
//! band is a range of the launch's order that begins where a batch, a tile and a subgroup begin:
//! so batches, schedule and counts are those of the whole launch, and so is every bit.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use crate::error::{Error, ErrorKind, Result};
use crate::machine::format::Format;
use crate::machine::image::{Image, Position};
use crate::machine::{Binding, Descriptor};
use crate::module::interface::Stage;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::launch::{Launch, Stats};
use crate::pipeline::order;
use crate::program::Program;
use crate::program::race_analysis::{LaunchExtent, OwnRow};

/// The widest batch, and the largest subgroup.
const WIDEST: u32 = 128;

/// An image that a launch fills and that is handed out in bands of rows: a plane as wide and high
/// as the launch, which the launch itself binds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Streamed {
    /// Where it is bound: the first array element of a storage image.
    pub binding: Binding,
    /// How texels are stored.
    pub format: Format,
    /// The bytes that every texel begins with.
    pub texel: Vec<u8>,
    /// How many bytes a band may take. It has at least the rows that hold a whole number of
    /// batches: 8 where 16 divides the width, 128 where the width is odd. Two bands are there at a
    /// time.
    pub band_bytes: u64,
}

impl Streamed {
    /// An image that begins as zeros, in bands of 32 MiB.
    pub fn new(set: u32, binding: u32, format: Format) -> Self {
        let texel = vec![0; format.texel_size() as usize];
        Self { binding: Binding { set, binding }, format, texel, band_bytes: 32 << 20 }
    }
}

/// Why an image must be there as a whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotStreamed {
    /// The launch is deeper than 1, and so goes over every row several times.
    Depth(u32),
    /// A shader may reach a row that is not that of its launch index, or it is not known that it
    /// does not.
    Reached {
        /// Its stage.
        stage: Stage,
        /// Its entry point.
        name: String,
    },
    /// Rows are filled from the last one up, and invocations depend on their order, which is the
    /// other way.
    Order,
}

impl fmt::Display for NotStreamed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Depth(depth) => write!(f, "the launch has a depth of {depth}, and goes over the image as often"),
            Self::Reached { stage, name } => write!(
                f,
                "{} `{name}` may reach texels of other rows than that of its own launch index",
                stage.name()
            ),
            Self::Order => f.write_str(
                "rows are filled from the last one up, and invocations depend on their order, which goes down",
            ),
        }
    }
}

impl std::error::Error for NotStreamed {}

/// Some rows of an image, filled.
#[derive(Clone, Copy, Debug)]
pub struct Band<'a> {
    image: &'a Image,
}

impl Band<'_> {
    /// How texels are stored.
    pub fn format(&self) -> Format {
        self.image.format()
    }

    /// Width and height of the whole image.
    pub fn size(&self) -> [u32; 2] {
        let [width, height, _] = self.image.shape().extent;
        [width, height]
    }

    /// The rows that are here, counted from the top of the whole image.
    pub fn rows(&self) -> Range<u32> {
        self.image.rows()
    }

    /// The bytes of a row that is here, texel by texel from the left.
    ///
    /// # Panics
    /// For any other row.
    #[track_caller]
    pub fn row_bytes(&self, row: u32) -> Vec<u8> {
        let rows = self.rows();
        assert!(rows.contains(&row), "row {row} is not among {} to {}", rows.start, rows.end);
        self.image.row_bytes(row)
    }

    /// R, G, B and A of a texel, by its place in the whole image, as a shader reads them; integers
    /// as numbers. What the format lacks is 0, and A is 1.
    ///
    /// # Panics
    /// Where the band has no such texel.
    #[track_caller]
    pub fn at(&self, x: u32, y: u32) -> [f32; 4] {
        let position = Position { at: [x.into(), y.into(), 0], ..Position::default() };
        let (index, rows) = (self.image.index(&position), self.rows());
        let index =
            index.unwrap_or_else(|| panic!("no texel ({x}, {y}) in rows {} to {}", rows.start, rows.end));
        self.image.format().decode_numbers(self.image.load(index)).map(|number| number as f32)
    }
}

/// A launch that can be run band by band, and how.
#[derive(Clone, Debug)]
pub struct Bands<'a> {
    launch: Launch<'a>,
    size: [u32; 2],
    image: &'a Streamed,
    row: OwnRow,
    /// Rows of a band, but for the last of the launch.
    each: u32,
}

impl<'a> Launch<'a> {
    /// The launch in bands of an image's rows, where that gives the same as the whole at once.
    ///
    /// # Errors
    /// Why it would not.
    pub fn bands(&self, size: [u32; 3], image: &'a Streamed) -> std::result::Result<Bands<'a>, NotStreamed> {
        let [width, height, depth] = size;
        if depth > 1 {
            return Err(NotStreamed::Depth(depth));
        }
        let programs: Vec<&Program> = self.pipeline.programs.iter().map(|program| &**program).collect();
        let extent = LaunchExtent { count: size, local: [1; 3], resources: self.resources };
        let row = extent
            .own_row(&programs, image.binding)
            .map_err(|program| NotStreamed::Reached { stage: program.stage, name: program.name.clone() })?;
        let ordered = || self.pipeline.order_dependent() || extent.shared(&programs).is_some();
        if row == OwnRow::Mirrored && ordered() {
            return Err(NotStreamed::Order);
        }
        // Powers of two: what both divide is the larger one.
        let whole_batches = WIDEST >> width.trailing_zeros().min(WIDEST.ilog2());
        let unit = order::SIDE.max(u64::from(whole_batches));
        let row_bytes = u64::from(width) * u64::from(image.format.texel_size());
        let each = (image.band_bytes / row_bytes.max(1) / unit * unit).max(unit);
        let each = u32::try_from(each).unwrap_or(u32::MAX / WIDEST * WIDEST);
        Ok(Bands { launch: self.clone(), size: [width, height], image, row, each })
    }
}

impl Bands<'_> {
    /// How many bands there are.
    pub fn count(&self) -> u32 {
        self.size[1].div_ceil(self.each)
    }

    /// The most rows of a band.
    pub fn rows(&self) -> u32 {
        self.each.min(self.size[1])
    }

    /// Runs the launch, and hands out each band when it is filled, the top one first, while the
    /// next one is being filled. `done` receives how many more invocations have ended.
    ///
    /// # Errors
    /// The trap of the lowest launch index, and what `take` returns; bands from there on are not
    /// handed out, and their invocations need not have run.
    pub fn run<const W: usize>(
        &self,
        done: &(dyn Fn(u64) + Sync),
        mut take: impl FnMut(Band<'_>) -> Result<()> + Send,
    ) -> Result<Stats>
    where
        LaneKernel: Width<W>,
    {
        let [width, height] = self.size;
        let dog = self.launch.watchdog(self.launch.count([width, height, 1])?);
        let mut tasks = 0;
        let mut stats = Stats::default();
        let mut filled: Option<Arc<Image>> = None;
        // One that trapped; those after it have lower launch indices, where rows are mirrored.
        let mut trapped = None;
        for at in 0..self.count() {
            let at = if self.row == OwnRow::Same { at } else { self.count() - 1 - at };
            let launched = at * self.each..height.min((at + 1).saturating_mul(self.each));
            let rows = match self.row {
                OwnRow::Same => launched.clone(),
                OwnRow::Mirrored => height - launched.end..height - launched.start,
            };
            let image = Image::band(width, height, rows, self.image.format, &self.image.texel)?;
            let mut resources = self.launch.resources.clone();
            resources.insert(self.image.binding, 0, Descriptor::Image(image.clone()));
            let mut run = || {
                let launch = Launch { pipeline: self.launch.pipeline, resources: &resources };
                let positions = [launched.start, launched.end].map(|row| u64::from(row) * u64::from(width));
                launch.run_positions::<W>(
                    [width, height, 1],
                    positions[0]..positions[1],
                    (&dog, &mut tasks),
                    done,
                )
            };
            let (taken, ran) = match filled.take() {
                None => (Ok(()), run()),
                Some(before) => rayon::join(|| hand_out(&mut take, &before), run),
            };
            taken?;
            match ran {
                Ok(more) => stats = stats.plus(&more),
                Err(error) if self.row == OwnRow::Same => return Err(error),
                Err(error) => trapped = Some(error),
            }
            if trapped.is_none() {
                filled = Some(image);
            }
        }
        if let Some(error) = trapped {
            return Err(error);
        }
        filled.map_or(Ok(()), |last| hand_out(&mut take, &last))?;
        Ok(stats)
    }

    /// The error where a launch cannot be run in bands.
    pub(crate) fn refused(image: &Streamed, why: &NotStreamed) -> Error {
        let Binding { set, binding } = image.binding;
        let message =
            format!("the image at set {set}, binding {binding} cannot be handed out in bands: {why}");
        Error::new(ErrorKind::InvalidArgument, message)
    }
}

fn hand_out(take: &mut impl FnMut(Band<'_>) -> Result<()>, image: &Image) -> Result<()> {
    take(Band { image })
}
