//! Translation validation: optimised and unoptimised programs must produce the same bits.
//!
//! The optimizer (store-to-load forwarding, constant folding, dead-code elimination, copy
//! propagation, register allocation, superinstructions) must not change the results of a shader.
//! [`Program::unoptimized`](anyhit_engine::program::Program::unoptimized), which skips all of these
//! passes, is the reference.

use crate::case::{Counts, Loaded, difference};
use crate::expect::Observed;
use crate::run::{RayMeasurements, run, run_ray};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_engine::pipeline::BatchWidth;

impl Loaded {
    /// Compares what the launch left behind, all of it, with runs of the reference at 1, 64 and
    /// 128 lanes.
    ///
    /// # Errors
    /// `Expectation` with the first difference.
    pub fn check_launch(&self, optimized: &Observed) -> Result<()> {
        let reference = self.assembled.unoptimized()?;
        let scene = &self.scene;
        let same = |width| self.same(width, optimized, &run(scene, &reference, width));
        BatchWidth::ALL.into_iter().try_for_each(same)
    }

    /// Compares what became of a ray of the scene, and what it left behind, with a run of the
    /// reference.
    ///
    /// # Errors
    /// `Expectation` with the first difference.
    pub fn check_ray(&self, at: usize, optimized: &Observed) -> Result<()> {
        let reference = self.assembled.unoptimized()?;
        let found = run_ray(&self.scene, &reference, at, &mut RayMeasurements::default());
        self.same(BatchWidth::One, optimized, &found)
    }

    fn same(&self, width: BatchWidth, optimized: &Observed, reference: &Observed) -> Result<()> {
        let rays = |observed: &Observed| format!("{:?}", observed.rays);
        let found = difference(optimized, reference, Counts::Rays).or_else(|| {
            let rays = [rays(optimized), rays(reference)];
            // Those of a launch are not always traced.
            let differ = !optimized.rays.is_empty() && rays[0] != rays[1];
            differ.then(|| format!("rays {} / {}", rays[0], rays[1]))
        });
        let Some(difference) = found else { return Ok(()) };
        let message = format!("optimised and not optimised ({width} lanes) disagree: {difference}");
        Err(Error::new(ErrorKind::Expectation, message)
            .at(Place::File(self.scene.path.clone()))
            .note("this is a bug in anyhit's optimizer, not in the shader: please report it with the module"))
    }
}
