//! Seeded random rays and shapes near the boundary between hit and miss.

use anyhit_engine::geometry::Ray;
use anyhit_engine::math::array;

type Matrix = [[f32; 4]; 3];

/// A ray in world space, with the transform of the instance that it is meant for.
#[derive(Clone, Copy, Debug)]
pub struct TransformedRay {
    /// The ray.
    pub ray: Ray,
    /// Object to world, row-major 3x4; none is the identity.
    pub matrix: Option<Matrix>,
}

impl From<Ray> for TransformedRay {
    /// The ray of an instance without a transform.
    fn from(ray: Ray) -> Self {
        Self { ray, matrix: None }
    }
}

/// A random generator of rays and shapes; a seed always gives the same ones.
#[derive(Debug)]
pub struct Draw {
    state: u64,
}

impl Draw {
    /// The generator for a seed.
    pub fn new(seed: u64) -> Self {
        Self { state: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) }
    }

    /// SplitMix64 (Steele, Lea and Flood 2014).
    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// 32 random bits.
    pub fn word(&mut self) -> u32 {
        (self.bits() >> 32) as u32
    }

    /// An integer in 0..n.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// True once in n draws.
    pub fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// A multiple of 2^-23 in [-1, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 2f32.powi(23) - 1.0
    }

    /// An integer in -4..=4.
    pub fn small(&mut self) -> f32 {
        self.below(9) as f32 - 4.0
    }

    /// A power of two: mostly near 1, else between 1e-42 (subnormal) and 1e30.
    pub fn scale(&mut self) -> f32 {
        let (least, most) = [(0, 0), (0, 0), (-4, 4), (-100, 100), (-140, 100)][self.below(5)];
        2f32.powi(least + self.below((most - least + 1) as usize) as i32)
    }

    /// A point of the integer lattice, or any point, at a random scale.
    pub fn point(&mut self) -> [f32; 3] {
        let s = self.scale();
        if self.one_in(2) { self.lattice(s) } else { self.anywhere(s) }
    }

    /// A point of the integer lattice times s.
    pub fn lattice(&mut self, s: f32) -> [f32; 3] {
        array::from_fn(|_| self.small() * s)
    }

    /// A point of the cube from -s to s.
    pub fn anywhere(&mut self, s: f32) -> [f32; 3] {
        array::from_fn(|_| self.unit() * s)
    }

    /// Centre and radius of a sphere; the radius may be 0 or negative.
    pub fn sphere(&mut self) -> ([f32; 3], f32) {
        let center = self.point();
        let s = 2f32.powi((self.size(center)).log2().round() as i32);
        let radius = match self.below(4) {
            0 => self.below(6) as f32 * s,
            1 => self.unit().abs() * s,
            2 => self.unit().abs() * s * 1e-6,
            _ => self.unit() * self.scale(),
        };
        (center, radius)
    }

    /// The greatest magnitude, or 1.
    pub fn size(&self, v: [f32; 3]) -> f32 {
        let size = v.iter().fold(0f32, |a, x| a.max(x.abs()));
        if size > 0.0 { size } else { 1.0 }
    }

    /// Positions, radii and caps of a linear swept sphere.
    pub fn linear_swept_sphere(&mut self) -> ([[f32; 3]; 2], [f32; 2], [bool; 2]) {
        let caps = [[true; 2], [false, true], [true, false], [false; 2], [true; 2]][self.below(5)];
        let s = self.scale();
        let (positions, radii) = match self.below(8) {
            // The lattice: exact tangents, parallels and joints are frequent.
            0..=2 => {
                let p = [self.lattice(s), self.lattice(s)];
                (p, [self.below(4) as f32 * s, self.below(4) as f32 * s])
            }
            3 => {
                let p = [self.lattice(s), self.lattice(s)];
                let r = (self.below(5) as f32 - 1.0) * s;
                (p, [r, (self.below(5) as f32 - 1.0) * s])
            }
            // Radii that differ in the last bit, or not.
            4 => {
                let r = self.unit().abs() * s;
                ([self.anywhere(s), self.anywhere(s)], [r, if self.one_in(2) { r } else { r.next_up() }])
            }
            // One ball almost contains the other: along an axis, |r0 - r1| within a bit of the
            // length.
            5 => {
                let p = self.lattice(s);
                let mut q = p;
                q[self.below(3)] += 3.0 * s;
                let r = self.unit().abs() * s;
                let other = [3.0 * s + r, (3.0 * s + r).next_down(), (3.0 * s + r).next_up()][self.below(3)];
                ([p, q], if self.one_in(2) { [r, other] } else { [other, r] })
            }
            // Thin needles and hairs.
            6 => {
                let r = self.unit().abs() * s * 1e-5;
                ([self.anywhere(s), self.anywhere(s)], [r, if self.one_in(2) { 0.0 } else { r * 0.4 }])
            }
            _ => ([self.anywhere(s), self.anywhere(s)], [self.unit() * s, self.unit().abs() * s]),
        };
        (positions, radii, caps)
    }

    /// A triangle, often a lattice's, sometimes a needle.
    pub fn triangle(&mut self) -> [[f32; 3]; 3] {
        let s = self.scale();
        match self.below(4) {
            0 | 1 => array::from_fn(|_| self.lattice(s)),
            2 => array::from_fn(|_| self.anywhere(s)),
            // A needle: the third vertex is a few bits off the edge.
            _ => {
                let (a, b) = (self.anywhere(s), self.anywhere(s));
                let u = self.unit();
                [a, b, array::from_fn(|i| a[i] + (b[i] - a[i]) * u)]
            }
        }
    }

    /// A box with min <= max, sometimes flat, sometimes with infinite sides.
    pub fn aabb(&mut self) -> ([f32; 3], [f32; 3]) {
        let s = self.scale();
        let (a, b) = if self.one_in(2) {
            (self.lattice(s), self.lattice(s))
        } else {
            (self.anywhere(s), self.anywhere(s))
        };
        let mut min: [f32; 3] = array::from_fn(|i| a[i].min(b[i]));
        let mut max: [f32; 3] = array::from_fn(|i| a[i].max(b[i]));
        if self.one_in(8) {
            min[self.below(3)] = f32::NEG_INFINITY;
        }
        if self.one_in(8) {
            max[self.below(3)] = f32::INFINITY;
        }
        if self.one_in(6) {
            let i = self.below(3);
            if min[i].is_finite() {
                max[i] = min[i];
            }
        }
        (min, max)
    }

    /// An instance's matrix: lattice (often singular), a product of scales, near-singular, any.
    pub fn matrix(&mut self) -> Matrix {
        let s = self.scale();
        let mut m: Matrix = match self.below(4) {
            0 => array::from_fn(|_| array::from_fn(|_| self.small().clamp(-2.0, 2.0))),
            1 => array::from_fn(|i| array::from_fn(|j| if i == j { self.unit() * s } else { 0.0 })),
            2 => {
                let row: [f32; 4] = array::from_fn(|_| self.unit());
                let mut near = row;
                near[self.below(3)] += f32::EPSILON * self.small();
                [row, near, array::from_fn(|_| self.unit())]
            }
            _ => array::from_fn(|_| array::from_fn(|_| self.unit() * s)),
        };
        for row in &mut m {
            row[3] = if self.one_in(2) { self.small() } else { self.unit() * s };
        }
        m
    }

    /// A ray, in one of three cases transformed, with its matrix (see `image`).
    pub fn transformed(&mut self, origin: [f32; 3], direction: [f32; 3]) -> TransformedRay {
        if !self.one_in(3) {
            return Ray::new(origin, direction).into();
        }
        let m = self.matrix();
        self.image(m, origin, direction)
    }

    /// The image of an object-space ray under a matrix, rounded: near the same edges, but on none
    /// exactly unless the matrix is of small integers. Returns the ray without a matrix if the
    /// image overflows f32.
    pub fn image(&mut self, m: Matrix, origin: [f32; 3], direction: [f32; 3]) -> TransformedRay {
        let apply = |v: [f32; 3], w: f32| -> [f32; 3] {
            array::from_fn(|i| m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2] + m[i][3] * w)
        };
        let ray = Ray::new(apply(origin, 1.0), apply(direction, 0.0));
        let finite = ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite());
        if finite { TransformedRay { ray, matrix: Some(m) } } else { Ray::new(origin, direction).into() }
    }

    /// A ray near the surface of a linear swept sphere: through it, grazing it, starting on it or
    /// along it.
    pub fn ray_near(&mut self, positions: [[f32; 3]; 2], radii: [f32; 2]) -> TransformedRay {
        let finite = |x: f32| if x.is_finite() { x } else { 0.0 };
        let [p, q] = positions.map(|v| v.map(finite));
        let s = self.size(array::from_fn(|i| q[i] - p[i]));
        let s = 2f32.powi(s.log2().round() as i32);
        if self.one_in(3) {
            // The ray connects points of the lattice.
            let origin = array::from_fn(|i| p[i] + self.small() * s);
            let direction = self.lattice(1.0);
            let ends = array::from_fn(|i| q[i] - p[i]);
            let direction = if self.one_in(4) { ends } else { direction };
            return self.transformed(origin, direction);
        }
        // A point of the surface, a normal there, and a direction at a chosen angle to it.
        let u = [0.0, 1.0, 0.5, self.unit().abs()][self.below(4)];
        let normal = self.direction();
        let r = radii[0] + (radii[1] - radii[0]) * u;
        let off = 1.0 + [0.0, 1e-7, -1e-7, 1e-4, -1e-3, -0.5][self.below(6)];
        let touched: [f32; 3] = array::from_fn(|i| p[i] + (q[i] - p[i]) * u + normal[i] * r * off);
        let free = self.direction();
        let slide: f32 = if self.one_in(2) { (0..3).map(|i| free[i] * normal[i]).sum() } else { 0.0 };
        let direction: [f32; 3] = array::from_fn(|i| free[i] - normal[i] * slide);
        let far = [0.0, 1.0, 3.0, 1e3, 1e6][self.below(5)] * s;
        let origin = array::from_fn(|i| touched[i] - direction[i] * far);
        let long = self.scale();
        self.transformed(origin, direction.map(|x| x * long))
    }

    /// A vector of about unit length, or an axis.
    pub fn direction(&mut self) -> [f32; 3] {
        if self.one_in(5) {
            let mut axis = [0.0; 3];
            axis[self.below(3)] = if self.one_in(2) { 1.0 } else { -1.0 };
            return axis;
        }
        let v = self.anywhere(1.0);
        let length = v.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-3);
        v.map(|x| x / length)
    }

    /// A ray through a target, starting at it or near or far before it: along an axis, between
    /// points of the lattice, or random; of any length.
    pub fn aim(&mut self, target: [f32; 3], s: f32) -> ([f32; 3], [f32; 3]) {
        let mut direction = if self.one_in(2) { self.lattice(1.0) } else { self.direction() };
        if direction == [0.0; 3] {
            direction[self.below(3)] = 1.0;
        }
        let far = [0.0, 0.5, 1.0, 2.0, 4.0, 64.0, 1e3, 1e6, 1e12][self.below(9)] * f64::from(s);
        let before = |i: usize| f64::from(target[i]) - f64::from(direction[i]) * far;
        let origin = array::from_fn(|i| before(i).clamp(-3e38, 3e38) as f32);
        let long = self.scale();
        // Components of very different sizes miss it by a bit.
        let mixed = self.one_in(8);
        let direction = direction.map(|x| x * long * if mixed && self.one_in(2) { 1e-30 } else { 1.0 });
        (origin, direction)
    }

    /// A ray through a vertex, an edge, the inside or past a triangle.
    pub fn ray_through(&mut self, v: [[f32; 3]; 3]) -> TransformedRay {
        let [b, c] = match self.below(5) {
            0 => [0.0, 0.0],
            1 => [0.5, 0.5],
            2 => [0.25, 0.0],
            3 => [self.unit().abs(), self.unit().abs()],
            _ => [self.unit().abs() * 0.5, self.unit().abs() * 0.5],
        };
        let target: [f32; 3] =
            array::from_fn(|i| v[0][i] + b * (v[1][i] - v[0][i]) + c * (v[2][i] - v[0][i]));
        let s = self.size(array::from_fn(|i| v[1][i] - v[0][i]));
        let s = 2f32.powi(s.log2().round() as i32);
        let direction = if self.one_in(2) { self.lattice(1.0) } else { self.direction() };
        let far = [1.0, 2.0, 1e3, 1e6][self.below(4)] * s;
        let origin = array::from_fn(|i| target[i] - direction[i] * far);
        let long = self.scale();
        self.transformed(origin, direction.map(|x| x * long))
    }

    /// A triangle fan's centre and rim, a ray exactly through the centre, an edge or the inside,
    /// and a matrix. The ray always hits the fan: the rim runs once around the ray's axis.
    pub fn fan(&mut self, count: usize) -> (Vec<[f32; 3]>, TransformedRay) {
        let (up, along, across) = [(0, 1, 2), (1, 2, 0), (2, 0, 1)][self.below(3)];
        let s = 2f32.powi(self.below(161) as i32 - 80);
        let mut points = vec![[0.0f32; 3]];
        for i in 0..count {
            let angle = (i as f32 + 0.3 * self.unit()) / count as f32 * std::f32::consts::TAU;
            let mut point = [0.0; 3];
            point[along] = angle.cos();
            point[across] = angle.sin();
            point[up] = self.unit();
            points.push(point);
        }
        let mut direction = [0.0; 3];
        direction[up] = if self.one_in(2) { 1.0 } else { -1.0 };
        // Through the centre, or through a point half-way to the rim, which is an exact point of
        // the edge: a half of each coordinate.
        let edge = points[1 + self.below(count)].map(|x| x * 0.5);
        let mut target = if self.one_in(2) { [0.0; 3] } else { edge };
        target[up] = -4.0 * direction[up];
        let place = |v: [f32; 3]| v.map(|x| x * s);
        let points: Vec<_> = points.into_iter().map(place).collect();
        let ray = Ray::new(place(target), direction);
        if self.one_in(2) {
            return (points, ray.into());
        }
        // Axes exchanged and scaled by powers of two: the ray's image is exact.
        let mut matrix = [[0.0; 4]; 3];
        let turn = self.below(3);
        for i in 0..3 {
            matrix[i][(i + turn) % 3] = if self.one_in(2) { 2.0 } else { -0.5 };
        }
        let apply = |v: [f32; 3]| array::from_fn(|i| v[(i + turn) % 3] * matrix[i][(i + turn) % 3]);
        let ray = Ray::new(apply(ray.origin), apply(ray.direction));
        (points, TransformedRay { ray, matrix: Some(matrix) })
    }
}
