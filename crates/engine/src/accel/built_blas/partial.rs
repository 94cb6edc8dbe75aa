//! A BLAS of which only those parts are built that rays have entered.

use std::sync::Arc;

use crate::accel::build_threads::BuildThreads;
use crate::accel::built_blas::build::{common_flags, cost_of};
use crate::accel::built_blas::collect::CollectedPrimitives;
use crate::accel::built_blas::{BuiltBlas, PrimitiveBlocks};
use crate::accel::geometry::Geometry;
use crate::accel::node::Node;
use crate::accel::primitive_numbers::PrimitiveNumbers;
use crate::accel::wide_bvh::growth::BvhGrowth;

/// The parts that are built, and what the others are made of. Rays find in them what they would
/// find in the whole BLAS.
#[derive(Debug)]
pub(in crate::accel) struct PartialBlas {
    built: Arc<BuiltBlas>,
    growth: BvhGrowth,
}

impl PartialBlas {
    /// Begins with nothing but the boxes of all primitives, none of which moves; `None` where no
    /// more than `most_whole` are active.
    pub(in crate::accel) fn begin(geometries: &[Geometry], most_whole: usize) -> Option<Self> {
        let numbers = PrimitiveNumbers::new(geometries);
        let collected = CollectedPrimitives::new(geometries, &numbers, BuildThreads::One);
        if collected.boxes.len() <= most_whole {
            return None;
        }
        let (bvh, growth) = BvhGrowth::begin(collected.boxes, cost_of(geometries));
        let built = BuiltBlas {
            blocks: PrimitiveBlocks::of(geometries, &numbers, &[], BuildThreads::One),
            order: Vec::new(),
            numbers,
            has_split_primitives: collected.has_split_primitives,
            bounds: *bvh.bounds(),
            bvh: Some(bvh),
            common_flags: common_flags(geometries),
        };
        Some(Self { built: Arc::new(built), growth })
    }

    /// What is built so far.
    pub(in crate::accel) fn built(&self) -> Arc<BuiltBlas> {
        self.built.clone()
    }

    /// Builds what a ray may open that enters at the root, and returns what is built then.
    /// `hit_children` returns a mask of the children of a node that the ray may hit.
    pub(in crate::accel) fn grow(
        &mut self,
        geometries: &[Geometry],
        hit_children: &mut dyn FnMut(&Node) -> u32,
    ) -> Arc<BuiltBlas> {
        let mut open: Vec<_> = self.built.bvh.iter().map(|bvh| bvh.root()).collect();
        while let Some(bvh) = &self.built.bvh {
            open = self.growth.undivided(bvh, open, hit_children);
            if open.is_empty() {
                break;
            }
            // Copies only what rays hold that are under way.
            let built = Arc::make_mut(&mut self.built);
            built.bvh.iter_mut().for_each(|bvh| self.growth.divide(bvh, &open));
            let new = &self.growth.order()[built.order.len()..];
            built.blocks.append(PrimitiveBlocks::of(geometries, &built.numbers, new, BuildThreads::One));
            built.order.extend(new);
        }
        self.built.clone()
    }
}
