//! The scenes and the rays: half of them from a camera, half in random directions.

use anyhit_engine::accel::{EndCaps, GeometryData, Indexing};
use anyhit_engine::geometry::{Bounds, Ray, Transform};
use anyhit_engine::math::random::Random;
use anyhit_scene::generate::{Chains, Grass, Ground, Hair, SphereScatter, UniformRange};

use crate::contender::PlacedInstance;
use crate::shape::{Corners, Shape};

pub const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Primitives of one kind, placed once or several times, and rays.
pub struct Scene {
    pub name: &'static str,
    pub data: GeometryData,
    pub shapes: Vec<Shape>,
    pub bounds: Bounds,
    pub matrices: Vec<[[f32; 4]; 3]>,
    pub rays: Vec<Ray>,
}

impl Scene {
    fn new(
        name: &'static str,
        data: GeometryData,
        matrices: Vec<[[f32; 4]; 3]>,
        rays: impl FnOnce(&Bounds, &mut Random) -> Vec<Ray>,
    ) -> Self {
        let shapes = Shape::all(&data);
        let bounds = shapes.iter().fold(Bounds::EMPTY, |all, shape| {
            let [min, max] = shape.corners();
            all.union(&Bounds { min, max })
        });
        let whole = matrices.iter().fold(Bounds::EMPTY, |all, matrix| all.union(&bounds.transformed(matrix)));
        let rays = rays(&whole, &mut Random::new(7));
        Self { name, data, shapes, bounds, matrices, rays }
    }

    /// The instances and the boxes around them.
    pub fn placed(&self) -> Vec<(PlacedInstance, Corners)> {
        self.matrices
            .iter()
            .map(|matrix| {
                let transform = (*matrix != IDENTITY).then(|| Transform::new(matrix).expect("regular"));
                let inverse = transform.as_ref().map_or(IDENTITY, Transform::world_to_object);
                let Bounds { min, max } = self.bounds.transformed(matrix);
                (PlacedInstance { transform, inverse }, [min, max])
            })
            .collect()
    }
}

/// One primitive, hit by about half of the rays.
fn single(name: &'static str, data: GeometryData, radius: f32) -> Scene {
    Scene::new(name, data, vec![IDENTITY], |bounds, random| {
        let middle: [f32; 3] = std::array::from_fn(|i| 0.5 * (bounds.min[i] + bounds.max[i]));
        (0..4096)
            .map(|_| {
                let (from, beside) = (random.sphere(), random.sphere());
                let distance = 2.0 + 8.0 * random.unit();
                let origin: [f32; 3] = std::array::from_fn(|i| middle[i] + from[i] * distance);
                let target: [f32; 3] = std::array::from_fn(|i| middle[i] + beside[i] * radius);
                Ray::new(origin, std::array::from_fn(|i| target[i] - origin[i]))
            })
            .collect()
    })
}

/// A camera above one side, and chords of the box around all.
fn field(name: &'static str, data: GeometryData, matrices: Vec<[[f32; 4]; 3]>, count: usize) -> Scene {
    Scene::new(name, data, matrices, |bounds, random| {
        let size: [f32; 3] = std::array::from_fn(|i| bounds.max[i] - bounds.min[i]);
        let at = |u: [f32; 3]| -> [f32; 3] { std::array::from_fn(|i| bounds.min[i] + u[i] * size[i]) };
        let side = size[0].max(size[2]);
        let mut eye = at([0.5, 1.0, 1.0]);
        eye[1] += 0.25 * side;
        eye[2] += 0.4 * side;
        (0..count)
            .map(|number| {
                let mut unit = || random.unit();
                let (a, b) = ([unit(), unit(), unit()], [unit(), unit(), unit()]);
                let (from, to) = if number % 2 == 0 { (eye, at(a)) } else { (at(a), at(b)) };
                Ray::new(from, std::array::from_fn(|i| to[i] - from[i]))
            })
            .collect()
    })
}

fn swept(positions: [[f32; 3]; 2], radii: [f32; 2]) -> GeometryData {
    GeometryData::LinearSweptSpheres {
        positions: positions.to_vec(),
        radii: radii.to_vec(),
        indices: None,
        indexing: Indexing::List,
        end_caps: EndCaps::Chained,
    }
}

fn capped(mut data: GeometryData) -> GeometryData {
    if let GeometryData::LinearSweptSpheres { end_caps, .. } = &mut data {
        // Each blade is a chain of its own; of a strand only the trailing caps count, but every
        // contender here has both.
        *end_caps = EndCaps::Chained;
    }
    data
}

/// Rotated, sheared and scaled transforms in rows of `side`.
fn places(side: usize, step: f32) -> Vec<[[f32; 4]; 3]> {
    let mut random = Random::new(3);
    let mut out = Vec::new();
    for i in 0..side {
        for k in 0..side {
            let [c, s] = random.direction();
            let (scale, shear) = (0.5 + random.unit(), 0.3 * random.unit());
            out.push([
                [scale * c, shear, -scale * s, i as f32 * step],
                [0.0, scale, 0.0, 0.0],
                [scale * s, 0.0, scale * c, k as f32 * step],
            ]);
        }
    }
    out
}

pub fn scenes(quick: bool) -> Vec<Scene> {
    let part = if quick { 10 } else { 1 };
    let grass = Grass {
        count: 30_000 / part as u32,
        seed: 1,
        area: [10.0, 10.0],
        height: UniformRange([0.2, 0.5]),
        radius: UniformRange([0.003, 0.008]),
        taper: 0.4,
        lean: 0.4,
    };
    let chains = Chains {
        count: 400 / part as u32,
        segments: 8,
        seed: 2,
        area: [10.0, 10.0],
        length: UniformRange([0.2, 0.35]),
        radius: UniformRange([0.05, 0.1]),
        taper: 0.8,
        bend: 0.5,
    };
    let hair = Hair {
        count: 4000 / part as u32,
        segments: 8,
        seed: 3,
        ball: 1.0,
        length: UniformRange([0.4, 0.6]),
        radius: UniformRange([0.002, 0.003]),
        taper: 0.3,
        gravity: 1.0,
        curl: 0.1,
    };
    let balls =
        |count| SphereScatter { count, seed: 4, area: [10.0, 10.0], radius: UniformRange([0.02, 0.1]) };
    let divisions = if quick { [80, 80] } else { [256, 256] };
    let ground = Ground { size: [10.0, 10.0], y: 0.0, divisions, amplitude: 0.5, hills: 2.0, seed: 5 };
    let count = 24_000 / part;
    vec![
        single(
            "one sphere",
            GeometryData::Spheres { positions: vec![[0.1, 0.2, 0.3]], radii: vec![0.7], indices: None },
            1.1,
        ),
        single("one swept sphere", swept([[0.1, 0.2, 0.3], [0.9, -0.3, 0.7]], [0.3, 0.15]), 0.7),
        single(
            "one triangle",
            GeometryData::Triangles {
                vertices: vec![[0.1, 0.2, 0.3], [1.3, 0.1, 0.9], [0.2, 1.4, 1.1]],
                indices: None,
                transform: None,
            },
            0.4,
        ),
        single("one box", GeometryData::Aabbs(vec![[-0.3, -0.1, 0.2, 0.4, 0.7, 0.9]]), 0.7),
        field("grass", capped(grass.generate()), vec![IDENTITY], count),
        field("chains", capped(chains.generate()), vec![IDENTITY], count),
        field("hair", capped(hair.generate()), vec![IDENTITY], count),
        field("spheres", balls(10_000 / part as u32).generate(), vec![IDENTITY], count),
        field("triangles", ground.generate(), vec![IDENTITY], count),
        field("instances", balls(500).generate(), places(8, 9.0), count),
    ]
}
