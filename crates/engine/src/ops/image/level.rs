//! The level of detail: selects mip levels from gradients or an operand (Vulkan, "Scale Factor
//! Operation, LOD Operation and Image Level(s) Selection").
//!
//! Where the specification leaves a choice: rho_x and rho_y are the lengths of the derivatives in
//! texels of level 0, the squares added in the order u, v, w, each operation rounded to binary32;
//! log2 is correctly rounded; the level of detail and its fraction have all their 24 bits; the
//! nearest level is the preferred `ceil(d + 0.5) - 1`. A NaN level of detail is the least one. The
//! limits are `maxSamplerLodBias` 16 and `maxSamplerAnisotropy` 16.

use crate::machine::sampler::{Filter, Sampler};

/// `maxSamplerLodBias`
pub const MAX_LOD_BIAS: f32 = 16.0;
/// `maxSamplerAnisotropy`
pub const MAX_ANISOTROPY: f32 = 16.0;

/// How a footprint in texels is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// `lambda_base`, the level of detail.
    pub lod: f32,
    /// N, the number of probes.
    pub probes: u32,
    /// Whether the probes lie along the derivatives by x, not those by y.
    pub along_x: bool,
}

/// The footprint of derivatives by x and y, each times the extent of level 0.
pub fn footprint(by_x: [f32; 3], by_y: [f32; 3], max_anisotropy: f32) -> Footprint {
    let length = |[u, v, w]: [f32; 3]| (u * u + v * v + w * w).sqrt();
    let (rho_x, rho_y) = (length(by_x), length(by_y));
    let (most, least) = if rho_x > rho_y { (rho_x, rho_y) } else { (rho_y, rho_x) };
    let limit = if max_anisotropy > 1.0 { max_anisotropy.min(MAX_ANISOTROPY) } else { 1.0 };
    let ratio = most / least;
    // 0 / 0: a point. Something / 0 is infinite, a line.
    let eta = if ratio.is_nan() { 1.0 } else { ratio.min(limit) };
    Footprint { lod: pxfm::f_log2f(most / eta), probes: eta.ceil() as u32, along_x: rho_x > rho_y }
}

/// lambda', from lambda_base and the bias of the instruction.
pub fn biased(base: f32, sampler: &Sampler, bias: f32) -> f32 {
    base + (sampler.lod_bias + bias).clamp(-MAX_LOD_BIAS, MAX_LOD_BIAS)
}

/// lambda, from lambda' and the least level of detail of the instruction.
pub fn lod(lod: f32, sampler: &Sampler, min_lod: f32) -> f32 {
    let least = if min_lod > sampler.min_lod { min_lod } else { sampler.min_lod };
    if lod > sampler.max_lod {
        sampler.max_lod
    } else if lod >= least {
        lod
    } else {
        least
    }
}

/// The levels, of `count`, that a level of detail selects, with their weights; 0 means that a level
/// is not read.
pub fn levels(lod: f32, mode: Filter, count: u32) -> [(u32, f32); 2] {
    let last = (count - 1) as f32;
    let level = if lod >= last {
        last
    } else if lod > 0.0 {
        lod
    } else {
        0.0
    };
    match mode {
        Filter::Nearest => [((level + 0.5).ceil() as u32 - 1, 1.0), (0, 0.0)],
        Filter::Linear => {
            let high = level.floor();
            let fraction = level - high;
            [(high as u32, 1.0 - fraction), ((high as u32 + 1).min(count - 1), fraction)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longer_derivative_gives_the_level() {
        // (3, 4) has length 5, (8, 0) length 8 = 2^3.
        let isotropic = footprint([3.0, 4.0, 0.0], [8.0, 0.0, 0.0], 1.0);
        assert_eq!(isotropic, Footprint { lod: 3.0, probes: 1, along_x: false });
        // Ratio 8 / 2 = 4 below the limit: level log2(8 / 4), four probes.
        let stretched = footprint([0.0, 8.0, 0.0], [2.0, 0.0, 0.0], 16.0);
        assert_eq!(stretched, Footprint { lod: 1.0, probes: 4, along_x: true });
        // Limit 3: level log2(8 / 3) is between 1 and 2.
        let limited = footprint([0.0, 8.0, 0.0], [2.0, 0.0, 0.0], 3.0);
        assert_eq!(limited.probes, 3);
        assert!((limited.lod - 1.415_037_5).abs() < 1e-6);
        // Ratio 2.5: three probes.
        assert_eq!(footprint([5.0, 0.0, 0.0], [2.0, 0.0, 0.0], 16.0).probes, 3);
    }

    #[test]
    fn degenerate_footprints() {
        let point = footprint([0.0; 3], [0.0; 3], 16.0);
        assert_eq!((point.lod, point.probes), (f32::NEG_INFINITY, 1));
        let line = footprint([4.0, 0.0, 0.0], [0.0; 3], 4.0);
        assert_eq!((line.lod, line.probes), (0.0, 4));
        assert_eq!(footprint([f32::NAN; 3], [1.0; 3], 4.0).probes, 1);
        assert_eq!(footprint([f32::INFINITY; 3], [1.0; 3], 4.0).lod, f32::INFINITY);
        // No limit is above 16, and none below 1.
        assert_eq!(footprint([64.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1e9).probes, 16);
        assert_eq!(footprint([64.0, 0.0, 0.0], [1.0, 0.0, 0.0], f32::NAN).probes, 1);
    }

    #[test]
    fn bias_and_clamps() {
        let sampler = Sampler { lod_bias: 1.5, min_lod: 1.0, max_lod: 4.0, ..Sampler::default() };
        let lod = |base, sampler: &Sampler, least| lod(biased(base, sampler, 0.0), sampler, least);
        assert_eq!([0.0, -1.0, 9.0, f32::NAN].map(|base| lod(base, &sampler, 0.0)), [1.5, 1.0, 4.0, 1.0]);
        // Both biases together are clamped.
        assert_eq!(biased(1.0, &sampler, 2.0), 4.5);
        assert_eq!(biased(1.0, &sampler, 20.0), 17.0);
        assert_eq!(lod(0.0, &sampler, 2.0), 2.0);
        let far = Sampler { lod_bias: -40.0, min_lod: -100.0, ..Sampler::default() };
        assert_eq!(lod(0.0, &far, -100.0), -16.0);
        assert_eq!(lod(0.0, &Sampler { lod_bias: 40.0, ..far }, 0.0), 16.0);
        // min_lod above max_lod: max_lod wins where it is exceeded.
        let crossed = Sampler { min_lod: 3.0, max_lod: 2.0, ..Sampler::default() };
        assert_eq!([2.5, 1.0].map(|base| lod(base, &crossed, 0.0)), [2.0, 3.0]);
    }

    #[test]
    fn a_half_goes_to_the_lower_number_and_weights_are_the_fraction() {
        let nearest = |lod| levels(lod, Filter::Nearest, 4)[0].0;
        assert_eq!([-1.0, 0.0, 0.5, 0.75, 1.5, 2.5, 2.51, 9.0].map(nearest), [0, 0, 0, 1, 1, 2, 3, 3]);
        let linear = |lod| levels(lod, Filter::Linear, 4);
        assert_eq!(linear(1.25), [(1, 0.75), (2, 0.25)]);
        assert_eq!(linear(-0.5), [(0, 1.0), (1, 0.0)]);
        assert_eq!(linear(3.0), [(3, 1.0), (3, 0.0)]);
        assert_eq!(linear(f32::INFINITY), [(3, 1.0), (3, 0.0)]);
        assert_eq!(levels(f32::NAN, Filter::Linear, 1), [(0, 1.0), (0, 0.0)]);
    }
}
