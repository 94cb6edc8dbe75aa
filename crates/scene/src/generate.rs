//! Seeded geometry: grass, hair, chains, scattered spheres, a plane, a heightfield.
//!
//! The numbers do not depend on the machine: integers, the four operations, square roots, and
//! correctly rounded sines. y is up, and everything is in a rectangle on the ground around the
//! origin.

use crate::read::{Parse, Span, Spanned, Table, TomlValue};
use anyhit_base::error::ErrorKind;
use anyhit_base::input::InputLimit;
use anyhit_engine::accel::{EndCaps, GeometryData, Indexing};
use anyhit_engine::math::array;
use anyhit_engine::math::random::Random;

/// A number or a range to choose from: `0.5` or `[0.2, 0.5]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformRange(pub [f32; 2]);

impl Parse for UniformRange {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if value.elements().is_none() {
            return f32::parse(value).map(|x| Self([x, x]));
        }
        let range = <[f32; 2]>::parse(value)?;
        if range[0] <= range[1] && range.iter().all(|x| x.is_finite()) {
            return Some(Self(range));
        }
        value.wrong(format!("`{range:?}` is not a range from a lower to a higher number"))
    }
}

/// Blades of grass: linear swept spheres in LIST mode without indices, root first.
#[derive(Clone, Debug, PartialEq)]
pub struct Grass {
    /// Number of blades.
    pub count: u32,
    /// The seed of the random numbers.
    pub seed: u64,
    /// Extent of the field along x and z.
    pub area: [f32; 2],
    /// Height of a blade.
    pub height: UniformRange,
    /// Radius at the root.
    pub radius: UniformRange,
    /// The radius at the tip divided by the radius at the root.
    pub taper: f32,
    /// The greatest horizontal distance of a tip from its root, in heights of its blade.
    pub lean: f32,
}

impl Grass {
    /// Reads the keys of this generator. Keys whose errors return early are read last, so that all
    /// are requested.
    pub fn parse(table: &Table<'_>) -> Option<Self> {
        let grass = Self {
            seed: table.or("seed", 0),
            area: table.or("area", [10.0, 10.0]),
            height: table.or("height", UniformRange([0.2, 0.5])),
            radius: table.or("radius", UniformRange([0.003, 0.008])),
            taper: table.or("taper", 0.4),
            lean: table.or("lean", 0.4),
            count: count(table, 10_000, 1)?,
        };
        Some(grass)
    }

    /// Generates two vertices per blade.
    pub fn generate(&self) -> GeometryData {
        let mut random = Random::new(self.seed);
        let (mut positions, mut radii) =
            (vec![[[0.0; 3]; 2]; self.count as usize], vec![[0.0; 2]; self.count as usize]);
        for (positions, radii) in positions.iter_mut().zip(&mut radii) {
            let [x, z] = on_ground(&mut random, self.area);
            let height = random.within(self.height.0);
            let lean = self.lean * random.unit() * height;
            let [dx, dz] = random.direction();
            let radius = random.within(self.radius.0);
            *positions = [[x, 0.0, z], [x + lean * dx, height, z + lean * dz]];
            *radii = [radius, radius * self.taper];
        }
        GeometryData::LinearSweptSpheres {
            positions: positions.into_flattened(),
            radii: radii.into_flattened(),
            indices: None,
            indexing: Indexing::List,
            end_caps: EndCaps::Chained,
        }
    }
}

/// Spheres that lie on the ground, apart from each other where there is room.
#[derive(Clone, Debug, PartialEq)]
pub struct SphereScatter {
    /// Number of spheres.
    pub count: u32,
    /// The seed of the random numbers.
    pub seed: u64,
    /// Extent along x and z.
    pub area: [f32; 2],
    /// Radius of a sphere.
    pub radius: UniformRange,
}

impl SphereScatter {
    /// Reads the keys of this generator.
    pub fn parse(table: &Table<'_>) -> Option<Self> {
        let scatter = Self {
            seed: table.or("seed", 0),
            area: table.or("area", [10.0, 10.0]),
            radius: table.or("radius", UniformRange([0.15, 0.45])),
            count: count(table, 10, 1)?,
        };
        Some(scatter)
    }

    /// Generates one position and radius per sphere.
    pub fn generate(&self) -> GeometryData {
        let mut random = Random::new(self.seed);
        let mut positions: Vec<[f32; 3]> = Vec::with_capacity(self.count as usize);
        let mut radii: Vec<f32> = Vec::with_capacity(self.count as usize);
        for _ in 0..self.count {
            let radius = random.within(self.radius.0);
            let mut candidate = on_ground(&mut random, self.area);
            // A few spheres are kept apart. Many may overlap, as the search would take long.
            let tries = if self.count <= 1000 { 32 } else { 0 };
            for _ in 0..tries {
                let apart = |(position, other): (&[f32; 3], &f32)| {
                    let (dx, dz) = (position[0] - candidate[0], position[2] - candidate[1]);
                    dx * dx + dz * dz > (radius + other) * (radius + other)
                };
                if positions.iter().zip(&radii).all(apart) {
                    break;
                }
                candidate = on_ground(&mut random, self.area);
            }
            positions.push([candidate[0], radius, candidate[1]]);
            radii.push(radius);
        }
        GeometryData::Spheres { positions, radii, indices: None }
    }
}

/// Chains of linear swept spheres in SUCCESSIVE mode, end caps CHAINED.
#[derive(Clone, Debug, PartialEq)]
pub struct Chains {
    /// Number of chains.
    pub count: u32,
    /// Segments per chain.
    pub segments: u32,
    /// The seed of the random numbers.
    pub seed: u64,
    /// Extent along x and z of the first vertices.
    pub area: [f32; 2],
    /// Length of a segment.
    pub length: UniformRange,
    /// Radius at a chain's first vertex.
    pub radius: UniformRange,
    /// The radius of each vertex divided by that of the previous one.
    pub taper: f32,
    /// How much each segment turns away: 0 is straight, 1 may turn by half a circle.
    pub bend: f32,
}

impl Chains {
    /// Reads the keys of this generator.
    pub fn parse(table: &Table<'_>) -> Option<Self> {
        let segments: u32 = table.or("segments", 4);
        let chains = Self {
            segments,
            seed: table.or("seed", 0),
            area: table.or("area", [10.0, 10.0]),
            length: table.or("length", UniformRange([0.2, 0.35])),
            radius: table.or("radius", UniformRange([0.05, 0.1])),
            taper: table.or("taper", 0.8),
            bend: table.or("bend", 0.5),
            count: count(table, 20, segments)?,
        };
        Some(chains)
    }

    /// Generates one vertex more than segments per chain, and one index per segment.
    pub fn generate(&self) -> GeometryData {
        let mut random = Random::new(self.seed);
        let mut strands = Strands::default();
        for _ in 0..self.count {
            let [x, z] = on_ground(&mut random, self.area);
            let radius = random.within(self.radius.0);
            let mut direction = [0.0, 1.0, 0.0];
            let mut position = [x, radius, z];
            strands.begin(position, radius);
            let mut radius = radius;
            for _ in 0..self.segments {
                direction = perturbed(direction, self.bend, &mut random);
                let length = random.within(self.length.0);
                position = advance(position, direction, length);
                radius *= self.taper;
                // Chains do not reach below the ground.
                position[1] = position[1].max(radius);
                strands.push(position, radius);
            }
        }
        strands.finish()
    }
}

/// Strands on a ball, bent by gravity and curl: SUCCESSIVE, CHAINED.
#[derive(Clone, Debug, PartialEq)]
pub struct Hair {
    /// Number of strands.
    pub count: u32,
    /// Segments per strand.
    pub segments: u32,
    /// The seed of the random numbers.
    pub seed: u64,
    /// Radius of the ball, whose centre is the origin.
    pub ball: f32,
    /// Length of a strand.
    pub length: UniformRange,
    /// Radius at the root.
    pub radius: UniformRange,
    /// The radius at the tip divided by the radius at the root.
    pub taper: f32,
    /// How much a strand turns downwards from root to tip.
    pub gravity: f32,
    /// How much each segment turns at random.
    pub curl: f32,
}

impl Hair {
    /// Reads the keys of this generator.
    pub fn parse(table: &Table<'_>) -> Option<Self> {
        let segments: u32 = table.or("segments", 8);
        let hair = Self {
            segments,
            seed: table.or("seed", 0),
            ball: table.or("ball", 1.0),
            length: table.or("length", UniformRange([0.4, 0.6])),
            radius: table.or("radius", UniformRange([0.002, 0.003])),
            taper: table.or("taper", 0.3),
            gravity: table.or("gravity", 1.0),
            curl: table.or("curl", 0.1),
            count: count(table, 1000, segments)?,
        };
        Some(hair)
    }

    /// Generates one vertex more than segments per strand, and one index per segment.
    pub fn generate(&self) -> GeometryData {
        let mut random = Random::new(self.seed);
        let mut strands = Strands::default();
        for _ in 0..self.count {
            let root = random.sphere();
            let length = random.within(self.length.0) / self.segments as f32;
            let radius = random.within(self.radius.0);
            let mut position = root.map(|x| x * self.ball);
            let mut direction = root;
            strands.begin(position, radius);
            for segment in 1..=self.segments {
                let done = segment as f32 / self.segments as f32;
                direction[1] -= self.gravity / self.segments as f32;
                direction = perturbed(normalized(direction), self.curl, &mut random);
                position = advance(position, direction, length);
                strands.push(position, radius * (1.0 + (self.taper - 1.0) * done));
            }
        }
        strands.finish()
    }
}

/// A grid of squares over the ground, two triangles each, counter-clockwise from above: flat, or
/// raised by seeded noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Extent along x and z.
    pub size: [f32; 2],
    /// Height of the flat ground.
    pub y: f32,
    /// Squares along x and z.
    pub divisions: [u32; 2],
    /// Greatest height above and below.
    pub amplitude: f32,
    /// Size of the largest hills.
    pub hills: f32,
    /// The seed of the random numbers.
    pub seed: u64,
}

impl Ground {
    /// Reads the keys of a flat ground.
    pub fn parse_plane(table: &Table<'_>) -> Option<Self> {
        let size = table.or("size", [10.0, 10.0]);
        let y = table.or("y", 0.0);
        let divisions = divisions(table, [1, 1])?;
        Some(Self { size, y, divisions, amplitude: 0.0, hills: 1.0, seed: 0 })
    }

    /// Reads the keys of hilly ground.
    pub fn parse_heightfield(table: &Table<'_>) -> Option<Self> {
        let ground = Self {
            size: table.or("size", [10.0, 10.0]),
            y: table.or("y", 0.0),
            amplitude: table.or("amplitude", 0.5),
            hills: table.or("hills", 2.0),
            seed: table.or("seed", 0),
            divisions: divisions(table, [64, 64])?,
        };
        if ground.hills > 0.0 {
            return Some(ground);
        }
        table.report().push(table.span().error("`hills`, the size of the hills, must be above 0"));
        None
    }

    /// Generates `(nx + 1) * (nz + 1)` vertices and `2 * nx * nz` triangles.
    pub fn generate(&self) -> GeometryData {
        let [nx, nz] = self.divisions;
        let mut vertices = Vec::with_capacity((nx as usize + 1) * (nz as usize + 1));
        for j in 0..=nz {
            for i in 0..=nx {
                let x = self.size[0] * (i as f32 / nx as f32 - 0.5);
                let z = self.size[1] * (j as f32 / nz as f32 - 0.5);
                vertices.push([x, self.y + self.height(x, z), z]);
            }
        }
        let mut indices = Vec::with_capacity(6 * nx as usize * nz as usize);
        for j in 0..nz {
            for i in 0..nx {
                let a = j * (nx + 1) + i;
                let (b, c, d) = (a + 1, a + nx + 1, a + nx + 2);
                indices.extend([a, c, b, b, c, d]);
            }
        }
        GeometryData::Triangles { vertices, indices: Some(indices), transform: None }
    }

    /// Four octaves of value noise, each with half the amplitude and half the wavelength of the
    /// previous one.
    fn height(&self, x: f32, z: f32) -> f32 {
        if self.amplitude == 0.0 {
            return 0.0;
        }
        let (mut sum, mut weight, mut scale) = (0.0, 0.5, 1.0 / self.hills);
        for octave in 0..4 {
            sum += weight * value_noise(x * scale, z * scale, self.seed.wrapping_add(octave));
            weight *= 0.5;
            scale *= 2.0;
        }
        self.amplitude * sum
    }
}

/// Value noise in [-1, 1]: random values at integer coordinates, smoothly interpolated.
fn value_noise(x: f32, z: f32, seed: u64) -> f32 {
    let (x0, z0) = (x.floor(), z.floor());
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (u, v) = (smooth(x - x0), smooth(z - z0));
    let at = |x: f32, z: f32| {
        // Each lattice point has a generator of its own; the first output already mixes all bits.
        let key = (x as i64 as u64).wrapping_mul(0x9E37_79B9) ^ (z as i64 as u64).rotate_left(32);
        2.0 * Random::new(Random::new(key ^ seed).bits()).unit() - 1.0
    };
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    lerp(lerp(at(x0, z0), at(x0 + 1.0, z0), u), lerp(at(x0, z0 + 1.0), at(x0 + 1.0, z0 + 1.0), u), v)
}

/// Vertices and indices of strands in SUCCESSIVE mode.
#[derive(Default)]
struct Strands {
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
    indices: Vec<u32>,
}

impl Strands {
    fn begin(&mut self, position: [f32; 3], radius: f32) {
        self.positions.push(position);
        self.radii.push(radius);
    }

    fn push(&mut self, position: [f32; 3], radius: f32) {
        self.indices.push(self.positions.len() as u32 - 1);
        self.begin(position, radius);
    }

    fn finish(self) -> GeometryData {
        GeometryData::LinearSweptSpheres {
            positions: self.positions,
            radii: self.radii,
            indices: Some(self.indices),
            indexing: Indexing::Successive,
            end_caps: EndCaps::Chained,
        }
    }
}

/// Reads `count`; reports an error if there are too many primitives, with `primitives_each` for
/// each of `count`.
fn count(table: &Table<'_>, default: u32, primitives_each: u32) -> Option<u32> {
    let count = match table.value("count") {
        None => Spanned { value: default, span: table.span() },
        Some(value) => Spanned::<u32>::parse(value)?,
    };
    let primitives = u64::from(count.value) * u64::from(primitives_each.max(1));
    within_limit(table, primitives, &count.span).then_some(count.value)
}

/// Whether the limit of a scene's primitives allows so many; reports an error if not.
fn within_limit(table: &Table<'_>, primitives: u64, span: &Span) -> bool {
    let limits = table.report().limits();
    let checked = limits.check(InputLimit::ScenePrimitives, primitives, ErrorKind::InvalidScene);
    checked.map_err(|error| table.report().push(error.at(span.place()))).is_ok()
}

fn divisions(table: &Table<'_>, default: [u32; 2]) -> Option<[u32; 2]> {
    let Some(value) = table.value("divisions") else { return Some(default) };
    let [nx, nz] = <[u32; 2]>::parse(value)?;
    if nx == 0 || nz == 0 {
        return value.wrong("a ground must have at least one square in each direction");
    }
    let primitives = (u64::from(nx) * u64::from(nz)).saturating_mul(2);
    within_limit(table, primitives, &value.span()).then_some([nx, nz])
}

fn on_ground(random: &mut Random, area: [f32; 2]) -> [f32; 2] {
    area.map(|extent| (random.unit() - 0.5) * extent)
}

/// The direction plus a random vector, normalized.
fn perturbed(direction: [f32; 3], amount: f32, random: &mut Random) -> [f32; 3] {
    let other = random.sphere();
    normalized(array::from_fn(|i| direction[i] + amount * other[i]))
}

/// The vector with length 1; straight up if the vector is zero.
fn normalized(a: [f32; 3]) -> [f32; 3] {
    let length = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
    if length > 1e-6 { a.map(|x| x / length) } else { [0.0, 1.0, 0.0] }
}

fn advance(from: [f32; 3], direction: [f32; 3], length: f32) -> [f32; 3] {
    array::from_fn(|i| from[i] + length * direction[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Positions, radii and the indices of SUCCESSIVE mode.
    fn strands(data: GeometryData) -> (Vec<[f32; 3]>, Vec<f32>, Vec<u32>) {
        match data {
            GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, end_caps } => {
                assert_eq!((end_caps, indexing), (EndCaps::Chained, Indexing::Successive));
                assert_eq!(positions.len(), radii.len());
                (positions, radii, indices.unwrap())
            }
            other => panic!("{other:?}"),
        }
    }

    fn grass() -> Grass {
        Grass {
            count: 2000,
            seed: 3,
            area: [4.0, 2.0],
            height: UniformRange([0.2, 0.5]),
            radius: UniformRange([0.003, 0.008]),
            taper: 0.4,
            lean: 0.5,
        }
    }

    #[test]
    fn grass_keeps_to_its_ranges() {
        let GeometryData::LinearSweptSpheres { positions, radii, indices: None, indexing, .. } =
            grass().generate()
        else {
            panic!()
        };
        assert_eq!((positions.len(), radii.len(), indexing), (4000, 4000, Indexing::List));
        let mut mean = 0.0;
        for (ends, radii) in positions.chunks(2).zip(radii.chunks(2)) {
            let (root, tip) = (ends[0], ends[1]);
            assert!(root[0].abs() <= 2.0 && root[1] == 0.0 && root[2].abs() <= 1.0);
            assert!((0.2..=0.5).contains(&tip[1]));
            let beside = ((tip[0] - root[0]).powi(2) + (tip[2] - root[2]).powi(2)).sqrt();
            assert!(beside <= 0.5 * tip[1] * 1.001);
            assert!((0.003..=0.008).contains(&radii[0]));
            assert_eq!(radii[1], radii[0] * 0.4);
            mean += f64::from(tip[1]) / 2000.0;
        }
        // The standard deviation of the mean is 0.3 / sqrt(12) / sqrt(2000) = 0.002.
        assert!((mean - 0.35).abs() < 0.01, "{mean}");
    }

    #[test]
    fn a_seed_chooses_one_field() {
        assert_eq!(grass().generate(), grass().generate());
        assert_ne!(grass().generate(), Grass { seed: 4, ..grass() }.generate());
    }

    #[test]
    fn spheres_lie_on_the_ground_apart() {
        let scatter =
            SphereScatter { count: 10, seed: 1, area: [10.0, 10.0], radius: UniformRange([0.15, 0.45]) };
        let GeometryData::Spheres { positions, radii, indices: None } = scatter.generate() else { panic!() };
        assert_eq!((positions.len(), radii.len()), (10, 10));
        for i in 0..10 {
            assert!((0.15..=0.45).contains(&radii[i]));
            assert_eq!(positions[i][1], radii[i]);
            for j in 0..i {
                let (dx, dz) = (positions[i][0] - positions[j][0], positions[i][2] - positions[j][2]);
                assert!(dx * dx + dz * dz > (radii[i] + radii[j]).powi(2));
            }
        }
    }

    #[test]
    fn chains_have_one_index_a_segment_and_taper() {
        let chains = Chains {
            count: 20,
            segments: 4,
            seed: 9,
            area: [6.0, 6.0],
            length: UniformRange([0.2, 0.35]),
            radius: UniformRange([0.05, 0.1]),
            taper: 0.8,
            bend: 0.5,
        };
        let (positions, radii, indices) = strands(chains.generate());
        assert_eq!(positions.len(), 100);
        // Vertices 4, 9, 14, ... end a chain, and no primitive starts there.
        let wanted: Vec<u32> = (0..100).filter(|k| k % 5 != 4).collect();
        assert_eq!(indices, wanted);
        for k in wanted {
            let k = k as usize;
            assert_eq!(radii[k + 1], radii[k] * 0.8);
            let d: f32 = (0..3).map(|i| (positions[k + 1][i] - positions[k][i]).powi(2)).sum();
            assert!(d.sqrt() <= 0.35 * 1.01, "{k}");
        }
    }

    #[test]
    fn hair_grows_from_the_ball() {
        let hair = Hair {
            count: 50,
            segments: 6,
            seed: 2,
            ball: 2.0,
            length: UniformRange([0.6, 0.6]),
            radius: UniformRange([0.01, 0.01]),
            taper: 0.5,
            gravity: 1.0,
            curl: 0.1,
        };
        let (positions, radii, indices) = strands(hair.generate());
        assert_eq!((positions.len(), indices.len()), (350, 300));
        for (strand, radii) in positions.chunks(7).zip(radii.chunks(7)) {
            let length = |a: [f32; 3]| (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
            assert!((length(strand[0]) - 2.0).abs() < 1e-5);
            for pair in strand.windows(2) {
                let step = length(array::from_fn(|i| pair[1][i] - pair[0][i]));
                assert!((step - 0.1).abs() < 1e-5);
            }
            assert_eq!(radii[0], 0.01);
            assert!((radii[6] - 0.005).abs() < 1e-8);
        }
    }

    #[test]
    fn a_plane_is_two_triangles_that_face_up() {
        let plane =
            Ground { size: [4.0, 2.0], y: -1.0, divisions: [1, 1], amplitude: 0.0, hills: 1.0, seed: 0 };
        let GeometryData::Triangles { vertices, indices, .. } = plane.generate() else { panic!() };
        assert_eq!(vertices, [[-2., -1., -1.], [2., -1., -1.], [-2., -1., 1.], [2., -1., 1.]]);
        // Both are counter-clockwise seen from +y: (c - a) x (b - a) = (0,0,2) x (4,0,0) = (0,8,0).
        assert_eq!(indices.unwrap(), [0, 2, 1, 1, 2, 3]);
    }

    #[test]
    fn a_heightfield_stays_within_its_amplitude_and_is_not_flat() {
        let field =
            Ground { size: [8.0, 8.0], y: 1.0, divisions: [32, 16], amplitude: 0.5, hills: 2.0, seed: 5 };
        let GeometryData::Triangles { vertices, indices, .. } = field.generate() else { panic!() };
        assert_eq!((vertices.len(), indices.unwrap().len()), (33 * 17, 6 * 32 * 16));
        assert!(vertices.iter().all(|v| (0.5..=1.5).contains(&v[1])));
        let (low, high) = vertices.iter().fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(v[1]), h.max(v[1])));
        assert!(high - low > 0.1);
    }
}
