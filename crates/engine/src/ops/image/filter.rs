//! Filtering: from coordinates to a colour (Vulkan, "Image Sample Operations").
//!
//! Coordinates in texels are `s * size + offset`, where not unnormalized, in binary32. Within a
//! level:
//!
//! * nearest: the texel `floor(u)`, as it is;
//! * linear: with `u - 0.5 = i0 + alpha`, the sum of `((w_i * w_j) * w_k) * texel` over k, then j,
//!   then i, lower numbers first; `w_i0 = 1 - alpha`, `w_i1 = alpha`. Weights have all 24 bits of a
//!   binary32 (`subTexelPrecisionBits` is not 8). Every operation is rounded to nearest even, none
//!   is contracted. A texel whose weight is 0 is left out, so that an infinity in it has no effect.
//!
//! Between levels: `w_hi * value_hi + w_lo * value_lo`; a level whose weight is 0 is left out. An
//! anisotropic footprint with N > 1 probes is the sum of the values at `(s, t, r) + (i / (N + 1) -
//! 0.5) * d(s, t, r)`, i from 1 to N, divided by N; for a cube the probes are directions, each with
//! a face of its own. With the reductions min and max, the least or greatest value replaces each
//! sum. Each lane is filtered by itself, so that the batch width does not change the result.
//!
//! Linear filters of cubes are seamless: beyond an edge lies the neighbouring face; beyond a corner
//! the mean of the three texels that meet there, `((own + along i) + along j) / 3`. Cubes have no
//! other address mode; nearest filters clamp to the edge.
//!
//! Integer formats are never filtered linearly (no such format has the feature): the nearest texel
//! of the nearest level is taken.

use crate::machine::format::Class;
use crate::machine::image::{Image, Position};
use crate::machine::sampler::{BorderColor, Filter, ReductionMode, Sampler};
use crate::math::array;
use crate::ops::image::{address, cube, level};

/// The source of the level of detail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lod {
    /// The instruction gives it.
    Explicit(f32),
    /// From the derivatives of (s, t, r) by x and by y.
    Gradients([[f32; 3]; 2]),
}

/// The texture lookup of one lane.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a> {
    /// The image.
    pub image: &'a Image,
    /// The sampler.
    pub sampler: &'a Sampler,
    /// (s, t, r), as many as there are; a direction for a cube.
    pub at: [f32; 3],
    /// The array coordinate.
    pub layer: f32,
    /// Added to coordinates in texels.
    pub offset: [i32; 3],
    /// D_ref of a depth comparison.
    pub reference: Option<f32>,
}

impl<'a> Lookup<'a> {
    /// A lookup at the origin of the first layer.
    pub fn new(image: &'a Image, sampler: &'a Sampler) -> Self {
        Self { image, sampler, at: [0.0; 3], layer: 0.0, offset: [0; 3], reference: None }
    }
}

/// A point on a layer, with face selection done.
#[derive(Clone, Copy, Debug)]
struct Point {
    at: [f32; 3],
    layer: i64,
}

impl Lookup<'_> {
    /// The filtered value, as [`Format::decode`](crate::machine::format::Format::decode) gives
    /// texels.
    pub fn sample(&self, lod: Lod, bias: f32, min_lod: f32) -> [u64; 4] {
        let (lod, probes, step) = self.footprint(lod);
        let lod = level::lod(level::biased(lod, self.sampler, bias), self.sampler, min_lod);
        let filter = if lod <= 0.0 { self.sampler.mag_filter } else { self.sampler.min_filter };
        let count = if self.sampler.unnormalized_coordinates { 1 } else { self.image.shape().levels };
        if self.is_integer() {
            let [(level, _), _] = level::levels(lod, Filter::Nearest, count);
            return self.nearest(&self.point(self.at), level);
        }
        let levels = level::levels(lod, self.sampler.mipmap_mode, count);
        let value = |at: [f32; 3]| {
            let point = self.point(at);
            let mut sum = WeightedReduction::new(self.sampler.reduction_mode);
            for (level, weight) in levels {
                if weight != 0.0 {
                    sum.add(weight, self.sample_level(&point, level, filter));
                }
            }
            sum.value()
        };
        if probes <= 1 {
            return bits(value(self.at));
        }
        let mut sum = WeightedReduction::new(self.sampler.reduction_mode);
        for probe in 1..=probes {
            let along = probe as f32 / (probes + 1) as f32 - 0.5;
            sum.add(1.0, value(array::from_fn(|axis| self.at[axis] + along * step[axis])));
        }
        let mean = match self.sampler.reduction_mode {
            ReductionMode::WeightedAverage => array::map(sum.value(), |sum| sum / probes as f32),
            ReductionMode::Min | ReductionMode::Max => sum.value(),
        };
        bits(mean)
    }

    /// The level that would be accessed, fractional between two levels, and lambda', which is not
    /// clamped (`OpImageQueryLod`).
    pub fn query_lod(&self, lod: Lod) -> [f32; 2] {
        let lambda = level::biased(self.footprint(lod).0, self.sampler, 0.0);
        let lod = level::lod(lambda, self.sampler, 0.0);
        let levels = level::levels(lod, self.sampler.mipmap_mode, self.image.shape().levels);
        [levels[0].0 as f32 + levels[1].1, lambda]
    }

    /// A texel of level 0 of a 2D image, by the address modes.
    pub fn plane_texel(&self, at: [i64; 2]) -> [f32; 4] {
        let point = Point { at: [0.0; 3], layer: 0 };
        floats(self.texel(&point, 0, [at[0], at[1], 0], Filter::Nearest))
    }

    /// Whether only one level is read, the level, and the first and last texel read in it; none of
    /// the coarser level if it is not read. For addresses clamped to the edge.
    pub fn footprint_texels(
        &self,
        lod: Lod,
        bias: f32,
        min_lod: f32,
        coarse: bool,
    ) -> (bool, u32, Option<[[u32; 3]; 2]>) {
        let base = self.footprint(lod).0;
        let lod = level::lod(level::biased(base, self.sampler, bias), self.sampler, min_lod);
        let filter = if lod <= 0.0 { self.sampler.mag_filter } else { self.sampler.min_filter };
        let levels = level::levels(lod, self.sampler.mipmap_mode, self.image.shape().levels);
        let single = levels[1].1 == 0.0;
        if single && coarse {
            return (single, levels[0].0, None);
        }
        let level = levels[usize::from(coarse)].0;
        let (point, extent) = (self.point(self.at), self.image.level_extent(level));
        let at = self.unnormalized(&point, level);
        let mut ends = [[0; 3]; 2];
        for axis in 0..self.image.shape().dimension.axes() {
            let [low, high] = match filter {
                Filter::Nearest => [address::floor(at[axis]).0; 2],
                Filter::Linear => {
                    let (first, fraction) = address::floor(at[axis] - 0.5);
                    [first, first + i64::from(fraction != 0.0)]
                }
            };
            let inside = |at: i64| at.clamp(0, i64::from(extent[axis]) - 1) as u32;
            (ends[0][axis], ends[1][axis]) = (inside(low), inside(high));
        }
        (single, level, Some(ends))
    }

    /// One component of the four texels that linear filtering of level 0 would use ("Texel
    /// Gathering"): of (i0, j1), (i1, j1), (i1, j0), (i0, j0); with `offsets`, of (i0, j0) moved by
    /// each.
    pub fn gather(&self, component: usize, offsets: Option<[[i32; 2]; 4]>) -> [u64; 4] {
        let point = self.point(self.at);
        let [(i, _), (j, _), _] = self.corner(&point, 0);
        let corners = offsets.unwrap_or([[0, 1], [1, 1], [1, 0], [0, 0]]);
        array::map(corners, |[x, y]| {
            let at = [i + i64::from(x), j + i64::from(y), 0];
            if self.is_integer() {
                self.texel(&point, 0, at, Filter::Nearest)[component]
            } else {
                u64::from(self.float_texel(&point, 0, at)[component].to_bits())
            }
        })
    }

    fn is_integer(&self) -> bool {
        self.image.format().class() != Class::Float
    }

    /// lambda_base, the number of probes and the vector along which they lie.
    fn footprint(&self, lod: Lod) -> (f32, u32, [f32; 3]) {
        let gradients = match lod {
            Lod::Explicit(lod) => return (lod, 1, [0.0; 3]),
            Lod::Gradients(gradients) => gradients,
        };
        let dimension = self.image.shape().dimension;
        let extent = array::map(self.image.level_extent(0), |side| side as f32);
        let [by_x, by_y] = array::map(gradients, |gradient| {
            if dimension.is_cube() {
                let face = cube::face(self.at);
                let on_face = cube::project(face, self.at);
                let [s, t] = cube::derivatives(on_face, cube::project(face, gradient));
                return [s * extent[0], t * extent[1], 0.0];
            }
            array::from_fn(|axis| if axis < dimension.axes() { gradient[axis] * extent[axis] } else { 0.0 })
        });
        let footprint = level::footprint(by_x, by_y, self.sampler.max_anisotropy);
        (footprint.lod, footprint.probes, gradients[usize::from(!footprint.along_x)])
    }

    fn point(&self, at: [f32; 3]) -> Point {
        let shape = self.image.shape();
        if !shape.dimension.is_cube() {
            let layer =
                if shape.dimension.is_arrayed() { address::layer(self.layer, shape.layers) } else { 0 };
            return Point { at, layer };
        }
        let face = cube::face(at);
        let [s, t] = cube::coordinates(cube::project(face, at));
        let cube =
            if shape.dimension.is_arrayed() { address::layer(self.layer, shape.layers / 6) } else { 0 };
        Point { at: [s, t, 0.0], layer: 6 * cube + i64::from(face) }
    }

    /// Coordinates in texels of a level.
    fn unnormalized(&self, point: &Point, level: u32) -> [f32; 3] {
        let extent = self.image.level_extent(level);
        let axes = self.image.shape().dimension.axes();
        array::from_fn(|axis| {
            if axis >= axes {
                return 0.0;
            }
            let scale = if self.sampler.unnormalized_coordinates { 1.0 } else { extent[axis] as f32 };
            point.at[axis] * scale + self.offset[axis] as f32
        })
    }

    /// (i0, alpha), (j0, beta), (k0, gamma)
    fn corner(&self, point: &Point, level: u32) -> [(i64, f32); 3] {
        let axes = self.image.shape().dimension.axes();
        let at = self.unnormalized(point, level);
        array::from_fn(|axis| if axis < axes { address::floor(at[axis] - 0.5) } else { (0, 0.0) })
    }

    fn nearest(&self, point: &Point, level: u32) -> [u64; 4] {
        let at = array::map(self.unnormalized(point, level), |coordinate| address::floor(coordinate).0);
        self.texel(point, level, at, Filter::Nearest)
    }

    fn sample_level(&self, point: &Point, level: u32, filter: Filter) -> [f32; 4] {
        if filter == Filter::Nearest {
            return floats(self.nearest(point, level));
        }
        let corner = self.corner(point, level);
        let mut sum = WeightedReduction::new(self.sampler.reduction_mode);
        let weights = array::map(corner, |(_, fraction)| [1.0 - fraction, fraction]);
        for k in 0..2 {
            for j in 0..2 {
                for i in 0..2 {
                    let weight = weights[0][i] * weights[1][j] * weights[2][k];
                    if weight != 0.0 {
                        let at = [corner[0].0 + i as i64, corner[1].0 + j as i64, corner[2].0 + k as i64];
                        sum.add(weight, self.float_texel(point, level, at));
                    }
                }
            }
        }
        sum.value()
    }

    /// A texel of a linear filter; beyond a cube's corner the mean of three texels.
    fn float_texel(&self, point: &Point, level: u32, at: [i64; 3]) -> [f32; 4] {
        let size = self.image.level_extent(level)[0];
        let face = point.layer % 6;
        let is_cube = self.image.shape().dimension.is_cube();
        if is_cube && cube::neighbour(face as u32, [at[0], at[1]], size).is_none() {
            let texels = array::map(cube::corner(face as u32, [at[0], at[1]], size), |(other, [i, j])| {
                let layer = point.layer - face + i64::from(other);
                floats(self.fetch(Some(Position { at: [i, j, 0], layer, sample: 0, level })))
            });
            return array::from_fn(|part| (texels[0][part] + texels[1][part] + texels[2][part]) / 3.0);
        }
        floats(self.texel(point, level, at, Filter::Linear))
    }

    /// The texel at integer coordinates, by the address modes.
    fn texel(&self, point: &Point, level: u32, at: [i64; 3], filter: Filter) -> [u64; 4] {
        let shape = self.image.shape();
        let extent = self.image.level_extent(level);
        let (mut at, mut layer) = (at, point.layer);
        if shape.dimension.is_cube() {
            if filter == Filter::Linear
                && let Some((other, [i, j])) = cube::neighbour((layer % 6) as u32, [at[0], at[1]], extent[0])
            {
                (at, layer) = ([i, j, 0], layer - layer % 6 + i64::from(other));
            }
            at = array::from_fn(|axis| at[axis].clamp(0, i64::from(extent[axis]) - 1));
            return self.fetch(Some(Position { at, layer, sample: 0, level }));
        }
        let mut wrapped = [0; 3];
        for axis in 0..shape.dimension.axes() {
            match address::wrap(self.sampler.address_mode[axis], at[axis], extent[axis]) {
                Some(inside) => wrapped[axis] = inside,
                None => return self.fetch(None),
            }
        }
        self.fetch(Some(Position { at: wrapped, layer, sample: 0, level }))
    }

    /// A texel of the image or, without a position, of the border; compared if the lookup has a
    /// reference.
    fn fetch(&self, position: Option<Position>) -> [u64; 4] {
        let format = self.image.format();
        let mut texel = match position {
            Some(position) => {
                let index = self.image.index(&position).expect("bug in anyhit: a wrapped texel is outside");
                format.decode(self.image.load(index))
            }
            None => self.border(),
        };
        if let (Some(reference), Some(compare)) = (self.reference, self.sampler.compare_op) {
            let reference = match reference {
                _ if !format.is_unorm() => reference,
                reference if reference > 1.0 => 1.0,
                reference if reference < 0.0 => 0.0,
                reference => reference,
            };
            let holds = compare.holds(reference, f32::from_bits(texel[0] as u32));
            texel[0] = if holds { u64::from(1f32.to_bits()) } else { 0 };
        }
        texel
    }

    /// The border colour; missing components of the format are filled in as for any texel.
    fn border(&self) -> [u64; 4] {
        let format = self.image.format();
        let one = format.one();
        let color = match self.sampler.border_color {
            BorderColor::TransparentBlack => [0; 4],
            BorderColor::OpaqueBlack => [0, 0, 0, one],
            BorderColor::OpaqueWhite => [one; 4],
        };
        let missing = [0, 0, 0, one];
        array::from_fn(|part| if part < usize::from(format.channels) { color[part] } else { missing[part] })
    }
}

/// A reduction of values: their weighted sum, least or greatest.
struct WeightedReduction {
    reduction: ReductionMode,
    accumulated: Option<[f32; 4]>,
}

impl WeightedReduction {
    fn new(reduction: ReductionMode) -> Self {
        Self { reduction, accumulated: None }
    }

    fn add(&mut self, weight: f32, value: [f32; 4]) {
        let value = match self.reduction {
            // A single texel keeps its bits.
            ReductionMode::WeightedAverage if weight != 1.0 => array::map(value, |part| weight * part),
            _ => value,
        };
        self.accumulated = Some(match self.accumulated {
            None => value,
            Some(before) => array::from_fn(|part| match self.reduction {
                ReductionMode::WeightedAverage => before[part] + value[part],
                ReductionMode::Min => {
                    if value[part] < before[part] {
                        value[part]
                    } else {
                        before[part]
                    }
                }
                ReductionMode::Max => {
                    if value[part] > before[part] {
                        value[part]
                    } else {
                        before[part]
                    }
                }
            }),
        });
    }

    fn value(&self) -> [f32; 4] {
        self.accumulated.unwrap_or_default()
    }
}

fn floats(texel: [u64; 4]) -> [f32; 4] {
    array::map(texel, |bits| f32::from_bits(bits as u32))
}

fn bits(color: [f32; 4]) -> [u64; 4] {
    array::map(color, |part| u64::from(part.to_bits()))
}
