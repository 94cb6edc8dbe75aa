//! `--shard` and `--result`: a share of the work of a long command, and its result.

use std::path::PathBuf;

use clap::Args;

use anyhit_base::atomic_file;
use anyhit_base::error::Result;
use anyhit_cases::shares::{Shard, ShareResult, ShareResults};

/// A share of the work, and its result.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Shares")]
pub(super) struct ShareArgs {
    /// Process the Kth of N shares of the work; all shards together process each piece once
    /// (docs/scale.md)
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Write the result as JSON, from which `anyhit merge` makes one report of all shards
    #[arg(long, value_name = "FILE")]
    result: Option<PathBuf>,
}

impl ShareArgs {
    /// The share that is asked for, if one is.
    pub(super) fn shard(&self) -> Option<Shard> {
        self.shard
    }

    /// The share that is asked for; else all of the work.
    pub(super) fn shard_or_whole(&self) -> Shard {
        self.shard.unwrap_or(Shard::WHOLE)
    }

    /// Whether a share or a result is asked for.
    pub(super) fn is_requested(&self) -> bool {
        self.shard.is_some() || self.result.is_some()
    }

    /// Whether a result is asked for.
    pub(super) fn has_result(&self) -> bool {
        self.result.is_some()
    }

    /// Writes the result, where that is asked for.
    ///
    /// # Errors
    /// `Io`.
    pub(super) fn write<R: ShareResult>(&self, results: &ShareResults<R>) -> Result<()> {
        match &self.result {
            Some(path) => atomic_file::write(path, results.to_json()?),
            None => Ok(()),
        }
    }
}
