//! Counts the blocks and branches that run.

use std::collections::HashMap;

use anyhit_engine::machine::{Batch, BlockIndex, Observer, ShaderIndex};

/// How many lanes came by, by shader: the observer.
#[derive(Clone, Debug, Default)]
pub struct BlockCounts {
    shader: ShaderIndex,
    /// By shader and block.
    blocks: Vec<Vec<u64>>,
    /// By shader, block and way.
    edges: Vec<HashMap<(BlockIndex, u32), u64>>,
}

impl BlockCounts {
    /// How often the blocks and edges of a shader ran.
    pub fn ran(&self, shader: ShaderIndex) -> ProgramCounts<'_> {
        let blocks = self.blocks.get(shader.index()).map_or(&[][..], Vec::as_slice);
        ProgramCounts { blocks, edges: self.edges.get(shader.index()) }
    }

    /// How many lanes entered a block of a shader.
    pub fn entered(&self, shader: ShaderIndex, block: BlockIndex) -> u64 {
        self.ran(shader).block(block)
    }

    fn count(&mut self, block: BlockIndex, lanes: u32) {
        if self.blocks.len() <= self.shader.index() {
            self.blocks.resize(self.shader.index() + 1, Vec::new());
        }
        let blocks = &mut self.blocks[self.shader.index()];
        if blocks.len() <= block.index() {
            blocks.resize(block.index() + 1, 0);
        }
        blocks[block.index()] += u64::from(lanes);
    }

    fn take(&mut self, block: BlockIndex, edge: u32, lanes: u32) {
        if self.edges.len() <= self.shader.index() {
            self.edges.resize(self.shader.index() + 1, HashMap::new());
        }
        *self.edges[self.shader.index()].entry((block, edge)).or_default() += u64::from(lanes);
    }
}

impl<const W: usize> Observer<W> for BlockCounts {
    fn resumed(&mut self, shader: ShaderIndex, _: &mut Batch<W>) {
        self.shader = shader;
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
