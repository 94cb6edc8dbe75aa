//! Counts the blocks and branches that run.

use std::collections::HashMap;

use crate::machine::{Batch, BlockIndex, Observer};

/// How many lanes came by, by shader: the observer.
#[derive(Clone, Debug, Default)]
pub struct BlockCounts {
    shader: usize,
    /// By shader and block.
    blocks: Vec<Vec<u64>>,
    /// By shader, block and way.
    edges: Vec<HashMap<(BlockIndex, u32), u64>>,
}

impl BlockCounts {
    /// How often the blocks and edges of a shader ran.
    pub fn ran(&self, shader: usize) -> ProgramCounts<'_> {
        let blocks = self.blocks.get(shader).map_or(&[][..], Vec::as_slice);
        ProgramCounts { blocks, edges: self.edges.get(shader) }
    }

    /// How many lanes entered a block of a shader.
    pub fn entered(&self, shader: usize, block: BlockIndex) -> u64 {
        self.ran(shader).block(block)
    }

    fn count(&mut self, block: BlockIndex, lanes: u32) {
        if self.blocks.len() <= self.shader {
            self.blocks.resize(self.shader + 1, Vec::new());
        }
        let blocks = &mut self.blocks[self.shader];
        if blocks.len() <= block.index() {
            blocks.resize(block.index() + 1, 0);
        }
        blocks[block.index()] += u64::from(lanes);
    }

    fn take(&mut self, block: BlockIndex, edge: u32, lanes: u32) {
        if self.edges.len() <= self.shader {
            self.edges.resize(self.shader + 1, HashMap::new());
        }
        *self.edges[self.shader].entry((block, edge)).or_default() += u64::from(lanes);
    }
}

impl<const W: usize> Observer<W> for BlockCounts {
    fn resumed(&mut self, shader: u32, _: &mut Batch<W>) {
        self.shader = shader as usize;
    }

    fn block(&mut self, batch: &Batch<W>) {
        self.count(batch.block, batch.mask.count());
    }

    fn edge(&mut self, block: BlockIndex, edge: u32, lanes: u32) {
        self.take(block, edge, lanes);
    }
}

/// How often blocks and edges of one program ran.
#[derive(Clone, Copy, Debug)]
pub struct ProgramCounts<'a> {
    /// By block.
    blocks: &'a [u64],
    /// By block and way.
    edges: Option<&'a HashMap<(BlockIndex, u32), u64>>,
}

impl ProgramCounts<'_> {
    /// How many lanes entered a block.
    pub fn block(&self, block: BlockIndex) -> u64 {
        self.blocks.get(block.index()).copied().unwrap_or(0)
    }

    /// How many lanes took a way of the branch that ends a block.
    pub fn edge(&self, block: BlockIndex, way: usize) -> u64 {
        self.edges.and_then(|edges| edges.get(&(block, way as u32))).copied().unwrap_or(0)
    }
}
