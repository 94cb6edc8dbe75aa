//! `render --shard`: some of the bands of a picture, as a result that merges into the whole one.

use crate::cli::share::ShareArgs;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_cases::shares::ShareResults;
use anyhit_cases::shares::render::{RenderResult, RenderWhole, RenderedBand};
use anyhit_engine::pipeline::{Band, BandedLaunch, RunOptions};

/// A share of a picture to be rendered.
pub(super) struct PictureShare<'a> {
    /// Which share, and where its result is written.
    pub share: &'a ShareArgs,
    /// What all shares have in common.
    pub whole: RenderWhole,
    /// All bands.
    pub bands: BandedLaunch<'a>,
}

impl PictureShare<'_> {
    /// Renders the bands of the share and writes the result.
    ///
    /// # Errors
    /// The trap of a shader, and `Io`.
    pub(super) fn run(self, options: RunOptions<'_>) -> Result<()> {
        let shard = self.share.shard_or_whole();
        let number = |number: usize| {
            u32::try_from(number).map_err(|_| {
                Error::new(ErrorKind::InvalidArgument, format!("{number} shards are too many for a picture"))
            })
        };
        let bands = self.bands.every(number(shard.number - 1)?, number(shard.of)?);
        let mut result = RenderResult::default();
        let mut keep = |band: Band<'_>| {
            result.bands.push(RenderedBand::of(band)?);
            Ok(())
        };
        bands.run(options, &mut keep)?;
        self.share.write(&ShareResults::new(self.whole, shard, result))
    }
}
