//! How a set of boxes is divided in two: at a plane across an axis, the one of some that costs a ray
//! least by the surface area heuristic (Wald, *On fast Construction of SAH-based Bounding Volume
//! Hierarchies*, 2007: the boxes' middles are counted in bins, and planes lie between bins).

use crate::math::four::Four;

/// A box that is to be placed in a tree: finite, in scaled units.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub struct Reference {
    pub low: [f32; 3],
    pub number: u32,
    pub high: [f32; 3],
}

/// Where infinite sides lie: what is finite lies in the unit cube.
pub const FAR: f32 = 2.0;

/// What a ray pays in a leaf, in visits of inner nodes.
#[derive(Clone, Copy, Debug)]
pub struct LeafCost {
    /// How many primitives a leaf has at most.
    pub most: usize,
    /// For coming to a leaf, or to each of them that more primitives would be.
    pub visit: f32,
    /// For each primitive.
    pub primitive: f32,
}

impl LeafCost {
    /// What so many primitives cost a ray that comes to all of them.
    #[inline(always)]
    pub fn of(&self, count: usize) -> f32 {
        let leaves = count.div_ceil(self.most);
        leaves as f32 * self.visit + count as f32 * self.primitive
    }
}

/// A box in the making; of the four numbers of a corner three count.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    pub low: Four,
    pub high: Four,
}

impl Extent {
    #[inline(always)]
    fn empty() -> Self {
        Self { low: Four::splat(f32::INFINITY), high: Four::splat(f32::NEG_INFINITY) }
    }

    #[inline(always)]
    fn grow(&mut self, low: Four, high: Four) {
        self.low = self.low.lesser(low);
        self.high = self.high.greater(high);
    }

    /// Half the surface; only orders choices.
    #[inline(always)]
    pub fn half_area(&self) -> f32 {
        let [x, y, z, _] = (self.high - self.low).to_array();
        x * y + y * z + z * x
    }
}

impl Reference {
    #[inline(always)]
    fn corners(&self) -> (Four, Four) {
        let four = |[x, y, z]: [f32; 3]| Four::new([x, y, z, 0.0]);
        (four(self.low), four(self.high))
    }

    /// Half the surface of the box.
    pub fn half_area(&self) -> f32 {
        let (low, high) = self.corners();
        Extent { low, high }.half_area()
    }
}

/// Some boxes that lie together.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    pub count: usize,
    /// Around all boxes.
    pub extent: Extent,
    /// Around their middles, times two.
    middles: Extent,
}

impl Part {
    #[inline(always)]
    fn empty() -> Self {
        Self { count: 0, extent: Extent::empty(), middles: Extent::empty() }
    }

    #[inline(always)]
    fn grow(&mut self, (low, high): (Four, Four)) {
        self.count += 1;
        self.extent.grow(low, high);
        self.middles.grow(low + high, low + high);
    }

    /// All of some boxes.
    pub fn around(references: &[Reference]) -> Self {
        let mut part = Self::empty();
        references.iter().for_each(|reference| part.grow(reference.corners()));
        part
    }
}

/// How many bins an axis has at most; a power of two.
const BINS: usize = 16;
/// How many for a few boxes, along the longest axis alone.
const FEW_BINS: usize = 8;
const FEW: usize = 32;
/// Of more boxes only some are counted.
const SAMPLE: usize = 512;
/// A sum with it has its integer part in its low bits.
const TO_INTEGER: f32 = 12_582_912.0;
/// An axis along which the middles lie closer than this is not divided by place.
const LEAST: f32 = 1e-30;

/// Memory for a split.
pub struct Bins {
    extents: [[Extent; BINS]; 3],
    counts: [[u32; BINS]; 3],
}

/// A plane between bins, and how boxes find their side of it.
struct Plane {
    axis: usize,
    /// The last bin on the left.
    last: u32,
    base: Four,
    scale: Four,
}

/// The bin of a box on each axis.
#[inline(always)]
fn bins_of((low, high): (Four, Four), base: Four, scale: Four) -> [u32; 4] {
    let at = ((low + high - base) * scale - Four::splat(0.5)) + Four::splat(TO_INTEGER);
    at.to_array().map(|sum| sum.to_bits() & (BINS as u32 - 1))
}

impl Bins {
    pub fn new() -> Self {
        Self { extents: [[Extent::empty(); BINS]; 3], counts: [[0; BINS]; 3] }
    }

    /// Divides at least two boxes, reordering them: those of the first part come first. `halve`: by
    /// number alone.
    pub fn split(
        &mut self,
        references: &mut [Reference],
        part: &Part,
        cost: &LeafCost,
        halve: bool,
    ) -> [Part; 2] {
        let plane = if halve { None } else { self.best_plane(references, part, cost) };
        let Some(plane) = plane else { return halves(references, part) };
        let (mut left, mut right) = (Part::empty(), Part::empty());
        let (mut at, mut end) = (0, references.len());
        while at < end {
            let corners = references[at].corners();
            if bins_of(corners, plane.base, plane.scale)[plane.axis] <= plane.last {
                left.grow(corners);
                at += 1;
            } else {
                right.grow(corners);
                end -= 1;
                references.swap(at, end);
            }
        }
        if left.count == 0 || right.count == 0 { halves(references, part) } else { [left, right] }
    }

    /// `None` where no plane divides the boxes.
    #[inline(always)]
    fn best_plane(&mut self, references: &[Reference], part: &Part, cost: &LeafCost) -> Option<Plane> {
        let base = part.middles.low;
        let sizes = (part.middles.high - base).to_array();
        let longest = (0..3).max_by(|&a, &b| sizes[a].total_cmp(&sizes[b])).unwrap_or(0);
        if sizes[longest] <= LEAST {
            return None;
        }
        let few = references.len() <= FEW;
        let bins = if few { FEW_BINS } else { BINS };
        let scale = |axis: usize| if sizes[axis] > LEAST { (bins as f32 - 0.01) / sizes[axis] } else { 0.0 };
        let scale = Four::new([scale(0), scale(1), scale(2), 0.0]);
        let axes = if few { longest..longest + 1 } else { 0..3 };
        for axis in axes.clone() {
            self.extents[axis][..bins].fill(Extent::empty());
            self.counts[axis][..bins].fill(0);
        }
        for reference in references.iter().step_by((references.len() / SAMPLE).max(1)) {
            let (low, high) = reference.corners();
            let places = bins_of((low, high), base, scale);
            for axis in axes.clone() {
                let bin = places[axis % 3] as usize % BINS;
                self.extents[axis][bin].grow(low, high);
                self.counts[axis][bin] += 1;
            }
        }
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in axes {
            if sizes[axis] <= LEAST {
                continue;
            }
            let (extents, counts) = (&self.extents[axis], &self.counts[axis]);
            // What lies right of the plane behind each bin.
            let mut right = [0.0f32; BINS];
            let (mut extent, mut count) = (Extent::empty(), 0);
            for bin in (1..bins).rev() {
                extent.grow(extents[bin].low, extents[bin].high);
                count += counts[bin];
                right[bin - 1] =
                    if count > 0 { extent.half_area() * cost.of(count as usize) } else { f32::INFINITY };
            }
            let (mut extent, mut count) = (Extent::empty(), 0);
            for bin in 0..bins - 1 {
                if counts[bin] == 0 {
                    continue;
                }
                extent.grow(extents[bin].low, extents[bin].high);
                count += counts[bin];
                let all = extent.half_area() * cost.of(count as usize) + right[bin];
                if best.is_none_or(|(least, ..)| all < least) {
                    best = Some((all, axis, bin));
                }
            }
        }
        best.map(|(_, axis, last)| Plane { axis, last: last as u32, base, scale })
    }
}

/// Divides by number, along the longest axis of the middles.
#[cold]
fn halves(references: &mut [Reference], part: &Part) -> [Part; 2] {
    let sizes = (part.middles.high - part.middles.low).to_array();
    let axis = (0..3).max_by(|&a, &b| sizes[a].total_cmp(&sizes[b])).unwrap_or(0);
    let middle = |reference: &Reference| reference.low[axis] + reference.high[axis];
    let half = references.len() / 2;
    references
        .select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.number.cmp(&b.number)));
    let (left, right) = references.split_at(half);
    [Part::around(left), Part::around(right)]
}
