//! How a set of boxes is divided among the children of a node: again and again in two, at a plane across
//! an axis, the one of some that costs a ray least by the surface area heuristic (Wald, *On fast
//! Construction of SAH-based Bounding Volume Hierarchies*, 2007: the boxes' middles are counted in
//! bins, and planes lie between bins).

use std::ops::Range;

use smallvec::SmallVec;

use crate::accel::node::WIDTH;
use crate::geometry::Bounds;
use crate::math::eight::Eights;
use crate::math::four::Four;

/// A box that is to be placed in a tree: the least corner, the number, and the greatest corner
/// negated, so that one operation on eight lanes, the lesser of two, makes the box around two.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub struct Reference([f32; 8]);

const I: f32 = f32::INFINITY;

/// Where infinite sides lie: what is finite lies in the unit cube.
pub const FAR: f32 = 2.0;

/// What a ray pays in a leaf, in visits of inner nodes.
#[derive(Clone, Copy, Debug)]
pub struct LeafCost {
    /// How many primitives a leaf has at most; a power of two.
    pub most: usize,
    /// For coming to a leaf, or to each of them that more primitives would be.
    pub visit: f32,
    /// For each primitive.
    pub primitive: f32,
    /// What fits into a leaf is divided where what is left of its cost is less than this share.
    pub divided: f32,
}

impl LeafCost {
    /// What so many primitives cost a ray that comes to all of them.
    #[inline(always)]
    pub fn of(&self, count: usize) -> f32 {
        let leaves = (count + self.most - 1) >> self.most.trailing_zeros();
        leaves as u32 as f32 * self.visit + count as u32 as f32 * self.primitive
    }
}

impl Reference {
    /// A box of nothing, numbered 0: the neutral element of [`Reference::union`].
    pub const EMPTY: Self = Self([I, I, I, 0.0, I, I, I, 0.0]);

    /// A box with its number.
    #[inline(always)]
    pub fn new(&Bounds { min, max }: &Bounds, number: u32) -> Self {
        Self([min[0], min[1], min[2], f32::from_bits(number), -max[0], -max[1], -max[2], 0.0])
    }

    /// A box from its least corner and its greatest one, negated.
    #[inline(always)]
    pub fn of([low, negated_high]: [Four; 2], number: u32) -> Self {
        let ([a, b, c, _], [d, e, f, _]) = (low.to_array(), negated_high.to_array());
        Self([a, b, c, f32::from_bits(number), d, e, f, 0.0])
    }

    /// The same box with another number.
    #[inline(always)]
    pub fn numbered(self, number: u32) -> Self {
        let mut corners = self.0;
        corners[3] = f32::from_bits(number);
        Self(corners)
    }

    /// The box around both, numbered 0.
    #[inline(always)]
    pub fn union(&self, other: &Self) -> Self {
        let low = self.low().lesser(other.low());
        Self::of([low, self.negated_high().lesser(other.negated_high())], 0)
    }

    /// The number.
    #[inline(always)]
    pub fn number(&self) -> u32 {
        self.0[3].to_bits()
    }

    /// The box.
    #[inline(always)]
    pub fn bounds(&self) -> Bounds {
        bounds_of(&self.0)
    }

    /// The least corner; 0 in the fourth lane.
    #[inline(always)]
    pub fn low(&self) -> Four {
        let [x, y, z, ..] = self.0;
        Four::new([x, y, z, 0.0])
    }

    /// The greatest corner, negated; 0 in the fourth lane.
    #[inline(always)]
    pub fn negated_high(&self) -> Four {
        let [.., x, y, z, w] = self.0;
        Four::new([x, y, z, w])
    }

    /// Twice the middle.
    #[inline(always)]
    fn middle(&self) -> Four {
        self.low() - self.negated_high()
    }

    /// Twice the middle on one axis.
    #[inline(always)]
    fn middle_on(&self, axis: usize) -> f32 {
        self.0[axis] - self.0[axis + 4]
    }
}

/// A box from corners as a reference holds them.
#[inline(always)]
fn bounds_of(&[a, b, c, _, d, e, f, _]: &[f32; 8]) -> Bounds {
    Bounds { min: [a, b, c], max: [-d, -e, -f] }
}

/// Half the surface of a box, from corners as a reference holds them; only orders choices.
#[inline(always)]
fn half_area(&[a, b, c, _, d, e, f, _]: &[f32; 8]) -> f32 {
    // Sides, both signs turned.
    let (x, y, z) = (a + d, b + e, c + f);
    x * y + y * z + z * x
}

/// Some references that stand together.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Around all boxes, as a reference holds it.
    corners: [f32; 8],
    /// Around their middles, times two.
    middles: [Four; 2],
    half_area: f32,
    /// Where among those that are divided.
    first: u32,
    count: u32,
    /// Whether it is to be a leaf, and no longer divided.
    is_leaf: bool,
}

impl Part {
    /// None.
    const EMPTY: Self = Self {
        corners: Reference::EMPTY.0,
        middles: [Four::ZERO; 2],
        half_area: 0.0,
        first: 0,
        count: 0,
        is_leaf: false,
    };

    /// All of some references.
    #[inline(always)]
    fn around<E: Eights>(eights: E, references: &[Reference], first: usize) -> Self {
        let mut corners = eights.splat(f32::INFINITY);
        let mut middles = [Four::splat(f32::INFINITY), Four::splat(f32::NEG_INFINITY)];
        for reference in references {
            corners = eights.if_below(eights.load(&reference.0), corners);
            let middle = reference.middle();
            middles = [middle.lesser(middles[0]), middle.greater(middles[1])];
        }
        let corners = eights.lanes(corners);
        let half_area = half_area(&corners);
        let (first, count) = (first as u32, references.len() as u32);
        Self { corners, middles, half_area, first, count, is_leaf: false }
    }

    /// How many references.
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// Whether it is to be a leaf.
    pub fn is_leaf(&self) -> bool {
        self.is_leaf
    }

    /// Where the references stand.
    #[inline(always)]
    fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// The box around all.
    pub fn bounds(&self) -> Bounds {
        bounds_of(&self.corners)
    }

    /// How far the middles lie apart, times two.
    #[inline(always)]
    fn sizes(&self) -> [f32; 4] {
        (self.middles[1] - self.middles[0]).to_array()
    }
}

/// The axis along which something is longest.
#[inline(always)]
fn longest([x, y, z, _]: [f32; 4]) -> usize {
    let first = if y > x { 1 } else { 0 };
    if z > x.max(y) { 2 } else { first }
}

/// How many bins an axis has at most; a power of two.
const BINS: usize = 16;
/// How many for a few boxes, along the longest axis alone.
const FEW_BINS: usize = 8;
const FEW: usize = 128;
/// So many are sorted instead; as many as there are lanes.
const SORTED: usize = 8;
/// Of more boxes only some are counted.
const SAMPLE: usize = 256;
/// A sum with it has its integer part in its low bits.
const TO_INTEGER: f32 = 12_582_912.0;
/// An axis along which the middles lie closer than this is not divided by place.
const LEAST: f32 = 1e-30;

/// What is divided, and memory for that.
#[derive(Debug)]
pub struct Divider {
    parts: [Part; WIDTH],
    /// Which of them stand in which order.
    order: SmallVec<[u8; WIDTH]>,
    extents: [[Reference; BINS]; 3],
    counts: [[u32; BINS]; 3],
}

/// A plane between bins, and how boxes find their side of it.
struct Plane {
    axis: usize,
    /// The last bin on the left.
    last: usize,
    base: Four,
    scale: Four,
}

/// The bin of a place on each axis, as a sum with [`TO_INTEGER`].
#[inline(always)]
fn bins_of(middle: Four, base: Four, scale: Four) -> Four {
    ((middle - base) * scale - Four::splat(0.5)) + Four::splat(TO_INTEGER)
}

/// The same on one axis.
#[inline(always)]
fn bin_of(middle: f32, base: f32, scale: f32) -> f32 {
    ((middle - base) * scale - 0.5) + TO_INTEGER
}

/// The bin in such a sum.
#[inline(always)]
fn bin_in(sum: f32) -> usize {
    sum.to_bits() as usize & (BINS - 1)
}

impl Divider {
    pub fn new() -> Self {
        Self {
            parts: [Part::EMPTY; WIDTH],
            order: SmallVec::new(),
            extents: [[Reference::EMPTY; BINS]; 3],
            counts: [[0; BINS]; 3],
        }
    }

    /// What the last division has made, in the order of the references.
    pub fn parts(&self) -> impl Iterator<Item = &Part> {
        self.order.iter().map(|&at| &self.parts[usize::from(at)])
    }

    /// Divides references, of which there are more than one, among the children of a node; all of them
    /// come to one part where they make a leaf. `halve`: by number alone.
    #[inline(always)]
    pub fn divide<E: Eights>(
        &mut self,
        eights: E,
        references: &mut [Reference],
        cost: &LeafCost,
        halve: bool,
    ) {
        self.parts[0] = Part::around(eights, references, 0);
        self.order.clear();
        self.order.push(0);
        while self.order.len() < WIDTH {
            // The largest of those that are no leaf; then of those that may be one.
            let mut chosen: Option<(usize, bool, f32)> = None;
            for (at, part) in self.parts[..self.order.len()].iter().enumerate() {
                let (must, area) = (part.count() > cost.most, part.half_area);
                let better = chosen.is_none_or(|(_, must_too, least)| match (must, must_too) {
                    (true, false) => true,
                    (false, true) => false,
                    _ => area > least,
                });
                if !part.is_leaf && better {
                    chosen = Some((at, must, area));
                }
            }
            let Some((at, must, _)) = chosen else { break };
            let whole = self.parts[at];
            if whole.count == 1 {
                self.parts[at].is_leaf = true;
                continue;
            }
            let these = &mut references[whole.range()];
            let half = self.split(eights, these, &whole, cost, halve);
            let (left, right) = these.split_at(half);
            let left = Part::around(eights, left, whole.first as usize);
            let right = Part::around(eights, right, whole.first as usize + half);
            let price = |part: &Part| part.half_area * cost.of(part.count());
            if !must && price(&left) + price(&right) >= cost.divided * price(&whole) {
                self.parts[at].is_leaf = true;
                continue;
            }
            let added = self.order.len();
            self.parts[at] = left;
            self.parts[added] = right;
            let place = self.order.iter().position(|&one| usize::from(one) == at).unwrap_or(0);
            self.order.insert(place + 1, added as u8);
        }
        for part in &mut self.parts[..self.order.len()] {
            part.is_leaf |= is_leaf(&references[part.range()], part, cost);
        }
    }

    /// Reorders at least two boxes, and says how many of them come to the left.
    #[inline(always)]
    fn split<E: Eights>(
        &mut self,
        eights: E,
        references: &mut [Reference],
        part: &Part,
        cost: &LeafCost,
        halve: bool,
    ) -> usize {
        if references.len() == 2 {
            return 1;
        }
        let sizes = part.sizes();
        let axis = longest(sizes);
        if halve || sizes[axis] <= LEAST {
            return halves(references, axis);
        }
        if references.len() <= SORTED {
            return sorted(eights, references, axis, cost);
        }
        let plane = if references.len() <= FEW {
            self.best_on_axis(eights, references, part, axis, cost)
        } else {
            self.best_plane(eights, references, part, cost)
        };
        let Some(plane) = plane else { return halves(references, axis) };
        let left = partition(references, &plane);
        if left == 0 || left == references.len() { halves(references, axis) } else { left }
    }

    /// `None` where no plane divides the boxes.
    #[inline(always)]
    fn best_plane<E: Eights>(
        &mut self,
        eights: E,
        references: &[Reference],
        part: &Part,
        cost: &LeafCost,
    ) -> Option<Plane> {
        let base = part.middles[0];
        let sizes = part.sizes();
        let scale = |axis: usize| if sizes[axis] > LEAST { (BINS as f32 - 0.01) / sizes[axis] } else { 0.0 };
        let scale = Four::new([scale(0), scale(1), scale(2), 0.0]);
        for axis in 0..3 {
            self.clear::<BINS>(axis);
        }
        for reference in references.iter().step_by((references.len() / SAMPLE).max(1)) {
            let corners = eights.load(&reference.0);
            let [x, y, z, _] = bins_of(reference.middle(), base, scale).to_array();
            for (axis, place) in [x, y, z].into_iter().enumerate() {
                self.count(eights, axis, bin_in(place), corners);
            }
        }
        let mut best = (f32::INFINITY, 0, 0);
        for (axis, &size) in sizes[..3].iter().enumerate() {
            if size > LEAST {
                let (price, last) = self.sweep::<E, BINS>(eights, axis, cost);
                if price < best.0 {
                    best = (price, axis, last);
                }
            }
        }
        let (price, axis, last) = best;
        (price < f32::INFINITY).then_some(Plane { axis, last, base, scale })
    }

    /// The same along one axis.
    #[inline(always)]
    fn best_on_axis<E: Eights>(
        &mut self,
        eights: E,
        references: &[Reference],
        part: &Part,
        axis: usize,
        cost: &LeafCost,
    ) -> Option<Plane> {
        self.clear::<FEW_BINS>(axis);
        let base = part.middles[0];
        let scale = (FEW_BINS as f32 - 0.01) / part.sizes()[axis];
        let first = base.to_array()[axis];
        for reference in references {
            let bin = bin_in(bin_of(reference.middle_on(axis), first, scale));
            self.count(eights, axis, bin, eights.load(&reference.0));
        }
        let (price, last) = self.sweep::<E, FEW_BINS>(eights, axis, cost);
        (price < f32::INFINITY).then_some(Plane { axis, last, base, scale: Four::splat(scale) })
    }

    #[inline(always)]
    fn clear<const COUNT: usize>(&mut self, axis: usize) {
        self.extents[axis][..COUNT].fill(Reference::EMPTY);
        self.counts[axis][..COUNT].fill(0);
    }

    #[inline(always)]
    fn count<E: Eights>(&mut self, eights: E, axis: usize, bin: usize, corners: E::Eight) {
        let extent = &mut self.extents[axis][bin];
        extent.0 = eights.lanes(eights.if_below(corners, eights.load(&extent.0)));
        self.counts[axis][bin] += 1;
    }

    /// The cheapest plane across an axis: what it costs, and the last bin on its left.
    #[inline(always)]
    fn sweep<E: Eights, const COUNT: usize>(&self, eights: E, axis: usize, cost: &LeafCost) -> (f32, usize) {
        let (extents, counts) = (&self.extents[axis], &self.counts[axis]);
        // What lies right of the plane behind each bin.
        let mut right = [f32::INFINITY; COUNT];
        let (mut extent, mut count) = (eights.splat(f32::INFINITY), 0);
        for bin in (1..COUNT).rev() {
            extent = eights.if_below(eights.load(&extents[bin].0), extent);
            count += counts[bin];
            if count > 0 {
                right[bin - 1] = half_area(&eights.lanes(extent)) * cost.of(count as usize);
            }
        }
        let mut best = (f32::INFINITY, 0);
        let (mut extent, mut count) = (eights.splat(f32::INFINITY), 0);
        for bin in 0..COUNT - 1 {
            if counts[bin] == 0 {
                continue;
            }
            extent = eights.if_below(eights.load(&extents[bin].0), extent);
            count += counts[bin];
            let all = half_area(&eights.lanes(extent)) * cost.of(count as usize) + right[bin];
            if all < best.0 {
                best = (all, bin);
            }
        }
        best
    }
}

/// Brings the boxes on the left of a plane before the others, and says how many they are. Written
/// without a branch that depends on a box: half of them would be mispredicted.
#[inline(always)]
#[allow(clippy::manual_swap, reason = "`swap` goes through memory")]
fn partition(references: &mut [Reference], plane: &Plane) -> usize {
    let (base, scale) = (plane.base.to_array()[plane.axis], plane.scale.to_array()[plane.axis]);
    let last = TO_INTEGER + plane.last as u32 as f32;
    let mut left = 0;
    for at in 0..references.len() {
        let is_left = bin_of(references[at].middle_on(plane.axis), base, scale) <= last;
        // Between `left` and here all lie on the right.
        let reference = references[at];
        references[at] = references[left];
        references[left] = reference;
        left += usize::from(is_left);
    }
    left
}

/// Sorts a few boxes along an axis, and says how many lie left of the cheapest plane.
#[inline(always)]
fn sorted<E: Eights>(eights: E, references: &mut [Reference], axis: usize, cost: &LeafCost) -> usize {
    let count = references.len();
    let mut middles = [f32::INFINITY; SORTED];
    let mut old = [references[0]; SORTED];
    for (at, reference) in references.iter().enumerate() {
        middles[at] = reference.middle_on(axis);
        old[at] = *reference;
    }
    let all = eights.load(&middles);
    for at in 0..count {
        // Its place: after those that are less, and those before it that are as great.
        let before = (1u32 << at) - 1;
        let this = eights.splat(middles[at]);
        let not_greater = eights.at_least(this, all) & before;
        let less = !eights.at_least(all, this) & !before;
        references[((not_greater | less) & 0xFF).count_ones() as usize] = old[at];
    }
    let mut right = [0.0; SORTED];
    let mut extent = eights.splat(f32::INFINITY);
    for at in (1..count).rev() {
        extent = eights.if_below(eights.load(&references[at].0), extent);
        right[at] = half_area(&eights.lanes(extent)) * cost.of(count - at);
    }
    let mut best = (f32::INFINITY, count / 2);
    let mut extent = eights.splat(f32::INFINITY);
    for at in 1..count {
        extent = eights.if_below(eights.load(&references[at - 1].0), extent);
        let price = half_area(&eights.lanes(extent)) * cost.of(at) + right[at];
        if price < best.0 {
            best = (price, at);
        }
    }
    best.1
}

/// Whether a leaf costs a ray less than a node over leaves of one.
#[inline(always)]
fn is_leaf(references: &[Reference], part: &Part, cost: &LeafCost) -> bool {
    let (count, area) = (part.count(), part.half_area);
    let single = || references.iter().map(|reference| half_area(&reference.0)).sum::<f32>() * cost.of(1);
    count <= cost.most && (count == 1 || area + single() >= area * cost.of(count))
}

/// Divides by number along an axis.
#[cold]
fn halves(references: &mut [Reference], axis: usize) -> usize {
    let half = references.len() / 2;
    references.select_nth_unstable_by(half, |a, b| {
        a.middle_on(axis).total_cmp(&b.middle_on(axis)).then(a.number().cmp(&b.number()))
    });
    half
}
