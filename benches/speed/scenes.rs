//! The benchmark scenes: a heightfield of triangles, a cloud of spheres, a meadow of swept spheres.

use std::sync::Arc;

use anyhit_engine::accel::{
    Blas, EndCaps, Geometry, GeometryData, GeometryFlags, Indexing, Packet, RayFlags, Tlas, TlasInstance,
    TraceRay,
};
use anyhit_engine::geometry::Ray;

/// A seeded generator of numbers (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// Evenly between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / 9_007_199_254_740_992.0)
    }
}

/// A pinhole camera; `right` and `up` are scaled by the tangent of half the field of view.
#[derive(Clone, Copy)]
pub struct Camera {
    pub eye: [f32; 3],
    pub forward: [f32; 3],
    pub right: [f32; 3],
    pub up: [f32; 3],
}

impl Camera {
    /// A camera with a vertical field of view of 45 degrees for pictures of 4 : 3.
    fn new(eye: [f64; 3], target: [f64; 3]) -> Self {
        let unit = |v: [f64; 3]| {
            let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            v.map(|x| x / length)
        };
        let f = unit(std::array::from_fn(|k| target[k] - eye[k]));
        let r = unit([-f[2], 0.0, f[0]]);
        let u = [r[1] * f[2] - r[2] * f[1], r[2] * f[0] - r[0] * f[2], r[0] * f[1] - r[1] * f[0]];
        let tangent = 22.5f64.to_radians().tan();
        Self {
            eye: eye.map(|x| x as f32),
            forward: f.map(|x| x as f32),
            right: r.map(|x| (x * tangent * 4.0 / 3.0) as f32),
            up: u.map(|x| (x * tangent) as f32),
        }
    }

    /// The camera and the direction of the light as the shaders read them: five vectors of four.
    pub fn inputs(&self) -> Vec<f32> {
        let light = [0.5f32, 0.75, 0.433];
        let vectors = [self.eye, self.forward, self.right, self.up, light];
        vectors.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0]).collect()
    }

    /// The rays through the centres of the pixels of a picture, in rows.
    pub fn rays(&self, [width, height]: [u32; 2]) -> Vec<Ray> {
        let mut rays = Vec::with_capacity((width * height) as usize);
        for y in 0..height {
            for x in 0..width {
                let sx = (x as f32 + 0.5) / width as f32 * 2.0 - 1.0;
                let sy = 1.0 - (y as f32 + 0.5) / height as f32 * 2.0;
                let d: [f32; 3] =
                    std::array::from_fn(|k| self.forward[k] + sx * self.right[k] + sy * self.up[k]);
                let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                rays.push(Ray::new(self.eye, d.map(|x| x / length)));
            }
        }
        rays
    }

    /// The rays of [`Self::rays`] in random order.
    pub fn shuffled_rays(&self, picture: [u32; 2]) -> Vec<Ray> {
        let mut rays = self.rays(picture);
        let mut random = Random(3);
        for at in (1..rays.len()).rev() {
            rays.swap(at, (random.bits() % (at as u64 + 1)) as usize);
        }
        rays
    }
}

/// A camera and one geometry, with the data that the shaders read.
pub struct Scene {
    pub camera: Camera,
    pub data: GeometryData,
    /// Vertex normals of a heightfield.
    pub normals: Vec<f32>,
    /// Centres and radii, one or two of them a primitive.
    pub spheres: Vec<[f32; 4]>,
}

/// Two triangles for each cell of a grid of n x n cells, displaced by a sum of waves.
pub fn heightfield(n: u32) -> Scene {
    let height = |x: f64, z: f64| {
        0.35 * (1.3 * x).sin() * (1.1 * z).cos()
            + 0.12 * (3.7 * x + 1.0).sin() * (4.1 * z + 0.5).sin()
            + 0.04 * (11.0 * x).sin() * (9.0 * z).cos()
    };
    let mut vertices = Vec::new();
    let mut normals = Vec::new();
    let mut indices = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let at = |k: u32| -5.0 + 10.0 * f64::from(k) / f64::from(n);
            let (x, z, e) = (at(i), at(j), 1e-4);
            vertices.push([x as f32, height(x, z) as f32, z as f32]);
            let slope_x = (height(x + e, z) - height(x - e, z)) / (2.0 * e);
            let slope_z = (height(x, z + e) - height(x, z - e)) / (2.0 * e);
            let length = (1.0 + slope_x * slope_x + slope_z * slope_z).sqrt();
            normals.extend([-slope_x / length, 1.0 / length, -slope_z / length].map(|x| x as f32));
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            let [b, c, d] = [a + 1, a + n + 1, a + n + 2];
            indices.extend([a, c, b, b, c, d]);
        }
    }
    Scene {
        camera: Camera::new([0.5, 2.2, 6.5], [0.0; 3]),
        data: GeometryData::Triangles { vertices, indices: Some(indices), transform: None },
        normals,
        spheres: Vec::new(),
    }
}

/// Small spheres in a slab.
pub fn spheres(count: usize) -> Scene {
    let mut random = Random(11);
    let spheres: Vec<[f32; 4]> = (0..count)
        .map(|_| {
            [(-5.0, 5.0), (0.0, 1.5), (-5.0, 5.0), (0.02, 0.08)].map(|(a, b)| random.between(a, b) as f32)
        })
        .collect();
    Scene {
        camera: Camera::new([0.5, 2.2, 7.5], [0.0, 0.3, 0.0]),
        data: GeometryData::Spheres {
            positions: spheres.iter().map(|&[x, y, z, _]| [x, y, z]).collect(),
            radii: spheres.iter().map(|s| s[3]).collect(),
            indices: None,
        },
        normals: Vec::new(),
        spheres,
    }
}

/// Long thin triangles of all sizes in all directions, over a floor of two large ones.
pub fn splinters(count: usize) -> Scene {
    let mut random = Random(5);
    let mut vertices: Vec<[f32; 3]> = Vec::new();
    for _ in 0..count {
        // Lengths from 0.02 to 5, most of them short; a hundredth as wide.
        let length = 5.0 * 0.004f64.powf(random.between(0.0, 1.0));
        let from = [(-5.0, 5.0), (0.0, 1.5), (-5.0, 5.0)].map(|(low, high)| random.between(low, high));
        let to = from.map(|x| x + random.between(-1.0, 1.0) * length);
        let beside = from.map(|x| x + random.between(-0.01, 0.01) * length);
        vertices.extend([from, to, beside].map(|point| point.map(|x| x as f32)));
    }
    let [a, b, c, d] = [[-6.0, -0.1, -6.0], [6.0, -0.1, -6.0], [6.0, -0.1, 6.0], [-6.0, -0.1, 6.0]];
    vertices.extend([a, c, b, a, d, c]);
    Scene {
        camera: Camera::new([0.5, 2.2, 7.5], [0.0, 0.3, 0.0]),
        data: GeometryData::Triangles { vertices, indices: None, transform: None },
        normals: Vec::new(),
        spheres: Vec::new(),
    }
}

/// The boxes around the spheres of [`spheres`].
pub fn boxes(count: usize) -> Scene {
    let scene = spheres(count);
    let data = GeometryData::Aabbs(boxes_around(&scene.spheres, 1));
    Scene { data, ..scene }
}

/// The boxes around the swept spheres of [`meadow`].
pub fn meadow_boxes(blades: usize) -> Scene {
    let scene = meadow(blades);
    let data = GeometryData::Aabbs(boxes_around(&scene.spheres, 2));
    Scene { data, ..scene }
}

/// A box around every `each` spheres, widened so that no rounding makes it too small.
fn boxes_around(spheres: &[[f32; 4]], each: usize) -> Vec<[f32; 6]> {
    let around = |group: &[[f32; 4]]| {
        let low = |k: usize| group.iter().map(|s| s[k] - s[3]).fold(f32::INFINITY, f32::min) - 1e-6;
        let high = |k: usize| group.iter().map(|s| s[k] + s[3]).fold(f32::NEG_INFINITY, f32::max) + 1e-6;
        [low(0), low(1), low(2), high(0), high(1), high(2)]
    };
    spheres.chunks(each).map(around).collect()
}

/// Blades of grass, a few spheres and chains: everything a linear swept sphere.
pub fn meadow(blades: usize) -> Scene {
    let mut random = Random(2024);
    let mut ends: Vec<[f32; 4]> = Vec::new();
    for _ in 0..blades {
        let (x, z) = (random.between(-5.0, 5.0), random.between(-5.0, 5.0));
        let (height, radius) = (random.between(0.2, 0.5), random.between(0.003, 0.008));
        let (lean_x, lean_z) = (random.between(-0.35, 0.35) * height, random.between(-0.35, 0.35) * height);
        ends.push([x, 0.0, z, radius].map(|x| x as f32));
        ends.push([x + lean_x, height, z + lean_z, radius * 0.4].map(|x| x as f32));
    }
    let mut balls = Vec::new();
    for _ in 0..10 {
        let radius = random.between(0.15, 0.45);
        let (x, z) = (random.between(-4.0, 4.0), random.between(-4.0, 4.0));
        balls.push([x, radius * 0.9, z, radius].map(|x| x as f32));
    }
    for _ in 0..20 {
        let (mut x, mut z, mut y) = (random.between(-4.5, 4.5), random.between(-4.5, 4.5), 0.0);
        let radius = random.between(0.02, 0.04);
        let mut points = Vec::new();
        for k in 0..5 {
            points.push([x, y, z, radius * (1.0 - 0.15 * f64::from(k))].map(|x| x as f32));
            x += random.between(-0.25, 0.25);
            z += random.between(-0.25, 0.25);
            y += random.between(0.15, 0.3);
        }
        ends.extend(points.windows(2).flatten());
    }
    ends.extend(balls.iter().flat_map(|&ball| [ball, ball]));
    Scene {
        camera: Camera::new([0.0, 1.3, 7.0], [0.0, 0.1, 0.0]),
        data: GeometryData::LinearSweptSpheres {
            positions: ends.iter().map(|&[x, y, z, _]| [x, y, z]).collect(),
            radii: ends.iter().map(|s| s[3]).collect(),
            indices: None,
            indexing: Indexing::List,
            end_caps: EndCaps::Chained,
        },
        normals: Vec::new(),
        spheres: ends,
    }
}

impl Scene {
    /// The indices of its vertices; a single 0 where it has none, as a buffer must not be empty.
    pub fn indices(&self) -> &[u32] {
        match &self.data {
            GeometryData::Triangles { indices: Some(indices), .. } => indices,
            _ => &[0],
        }
    }

    /// Its BLAS.
    pub fn blas(&self, flags: GeometryFlags) -> Arc<Blas> {
        Blas::new(vec![Geometry::new(self.data.clone(), flags)]).expect("a valid geometry")
    }

    /// Its BLAS with the BVH, which the first packet builds.
    pub fn built(&self, flags: GeometryFlags) -> Arc<Blas> {
        let tlas = self.tlas(flags);
        self.build(&tlas);
        tlas.instances()[0].blas.clone()
    }

    /// Builds the BVH of its BLAS, of which nothing is built yet: traces the first packet.
    pub fn build(&self, tlas: &Tlas) {
        let trace = |ray| TraceRay { ray, flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 };
        let traces: Vec<_> = self.camera.rays([8, 8]).into_iter().map(trace).collect();
        assert!(Packet::default().trace(tlas, &traces, false, &mut Vec::new()), "no shader decides");
        assert!(tlas.instances()[0].blas.has_bvh(), "no ray came to it");
    }

    /// Its BLAS placed once.
    pub fn tlas(&self, flags: GeometryFlags) -> Arc<Tlas> {
        let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        Tlas::new(vec![TlasInstance::of(self.blas(flags), identity)]).expect("a valid instance")
    }

    /// Its BLAS in 8 x 8 places, every other one turned.
    pub fn tiled(&self) -> Arc<Tlas> {
        placed(&self.blas(GeometryFlags::OPAQUE), 8)
    }
}

/// A BLAS in side x side places.
pub fn placed(blas: &Arc<Blas>, side: u32) -> Arc<Tlas> {
    let instances = tiles(side).map(|transform| TlasInstance::of(blas.clone(), transform));
    Tlas::new(instances.collect()).expect("valid instances")
}

/// Side x side places that together are as wide as one, every other one turned: a transform each,
/// in rows.
pub fn tiles(side: u32) -> impl Iterator<Item = [[f32; 4]; 3]> {
    (0..side * side).map(move |number: u32| {
        let at = |k: u32| -5.0 + 10.0 * (k as f32 + 0.5) / side as f32;
        let (i, j, s) = (number % side, number / side, 1.0 / side as f32);
        match (i + j) % 2 {
            0 => [[s, 0.0, 0.0, at(i)], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, s, at(j)]],
            _ => [[0.0, 0.0, s, at(i)], [0.0, 0.5, 0.0, 0.0], [-s, 0.0, 0.0, at(j)]],
        }
    })
}
