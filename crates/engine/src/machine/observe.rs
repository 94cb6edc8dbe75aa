//! Observers of a running batch.

use crate::machine::batch::Batch;
use crate::machine::index::{BlockIndex, OpIndex, ShaderIndex};
use crate::machine::resource::Bindings;

/// Observes what a batch does; the unit type observes nothing and costs nothing.
pub trait Observer<const W: usize> {
    /// Whether an observer of this type is called at all; a constant, so that the code for an
    /// inactive observer compiles away.
    fn is_active() -> bool
    where
        Self: Sized,
    {
        true
    }

    /// The lanes of a batch of a pipeline's shader are about to begin: constants and
    /// builtins are in their registers, variables are zero. Payload and hit attributes follow.
    fn began(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        let _ = (shader, batch);
    }

    /// A batch of a pipeline's shader begins to run, or goes on after it stopped.
    fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        let _ = (shader, batch);
    }

    /// A batch of a pipeline's shader goes on where the observer paused it.
    fn continued(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        let _ = (shader, batch);
    }

    /// The interpreter handed the batch back: it is done, or waits for the pipeline.
    fn stopped(&mut self, shader: ShaderIndex, batch: &Batch<W>) {
        let _ = (shader, batch);
    }

    /// The running lanes enter the batch's block.
    fn block(&mut self, batch: &Batch<W>) {
        let _ = batch;
    }

    /// Called before each operation; `true` pauses the batch there. Of one that hands the batch to
    /// the pipeline, this is all that is told.
    fn before(&mut self, batch: &mut Batch<W>, op: OpIndex) -> bool {
        let _ = (batch, op);
        false
    }

    /// Called after each operation that stopped neither the batch nor all of its lanes: its results
    /// lie in the registers, and may be changed there.
    fn after(&mut self, batch: &mut Batch<W>, bindings: &Bindings, op: OpIndex) {
        let _ = (batch, bindings, op);
    }

    /// Called before the running lanes leave the batch's block by its terminator; `true` pauses the
    /// batch there.
    fn terminator(&mut self, batch: &mut Batch<W>) -> bool {
        let _ = batch;
        false
    }

    /// A number of lanes take an edge of the conditional branch or switch that ends a block. Edge 0
    /// is taken where the condition holds and 1 where not; those of a switch are numbered by case,
    /// with the default last.
    fn edge(&mut self, block: BlockIndex, edge: u32, lanes: u32) {
        let _ = (block, edge, lanes);
    }
}

/// What observes a whole launch or dispatch, whose batches have one lane or 64.
pub trait LaunchObserver: Observer<1> + Observer<64> {}

impl<O: Observer<1> + Observer<64>> LaunchObserver for O {}

impl<const W: usize> Observer<W> for () {
    fn is_active() -> bool {
        false
    }
}

/// A borrowed observer. The interpreter is compiled for `&mut dyn Observer` and for `()` only.
impl<const W: usize, O: Observer<W> + ?Sized> Observer<W> for &mut O {
    fn began(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        (**self).began(shader, batch);
    }

    fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        (**self).resumed(shader, batch);
    }

    fn continued(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        (**self).continued(shader, batch);
    }

    fn stopped(&mut self, shader: ShaderIndex, batch: &Batch<W>) {
        (**self).stopped(shader, batch);
    }

    fn block(&mut self, batch: &Batch<W>) {
        (**self).block(batch);
    }

    fn before(&mut self, batch: &mut Batch<W>, op: OpIndex) -> bool {
        (**self).before(batch, op)
    }

    fn after(&mut self, batch: &mut Batch<W>, bindings: &Bindings, op: OpIndex) {
        (**self).after(batch, bindings, op);
    }

    fn terminator(&mut self, batch: &mut Batch<W>) -> bool {
        (**self).terminator(batch)
    }

    fn edge(&mut self, block: BlockIndex, edge: u32, lanes: u32) {
        (**self).edge(block, edge, lanes);
    }
}

/// Calls both observers, the first one first. Either can pause the batch.
impl<const W: usize, A: Observer<W>, B: Observer<W>> Observer<W> for (A, B) {
    fn is_active() -> bool {
        A::is_active() || B::is_active()
    }

    fn began(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        self.0.began(shader, batch);
        self.1.began(shader, batch);
    }

    fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        self.0.resumed(shader, batch);
        self.1.resumed(shader, batch);
    }

    fn continued(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        self.0.continued(shader, batch);
        self.1.continued(shader, batch);
    }

    fn stopped(&mut self, shader: ShaderIndex, batch: &Batch<W>) {
        self.0.stopped(shader, batch);
        self.1.stopped(shader, batch);
    }

    fn block(&mut self, batch: &Batch<W>) {
        self.0.block(batch);
        self.1.block(batch);
    }

    fn before(&mut self, batch: &mut Batch<W>, op: OpIndex) -> bool {
        let pauses = self.0.before(batch, op);
        self.1.before(batch, op) || pauses
    }

    fn after(&mut self, batch: &mut Batch<W>, bindings: &Bindings, op: OpIndex) {
        self.0.after(batch, bindings, op);
        self.1.after(batch, bindings, op);
    }

    fn terminator(&mut self, batch: &mut Batch<W>) -> bool {
        let pauses = self.0.terminator(batch);
        self.1.terminator(batch) || pauses
    }

    fn edge(&mut self, block: BlockIndex, edge: u32, lanes: u32) {
        self.0.edge(block, edge, lanes);
        self.1.edge(block, edge, lanes);
    }
}
