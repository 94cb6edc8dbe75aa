//! The cursor against its definition: all primitives that the ray meets in one list, ascending by
//! (t, instance, geometry, primitive), walked from its start. The list is made by a plain scan with
//! the intersectors; trees, packing and heaps of the traversal have no part in it.

use std::sync::Arc;

use anyhit_engine::accel::{
    Blas, Candidate, Cursor, EndCaps, Geometry, GeometryData, GeometryFlags, HitKind, Indexing,
    InstanceFlags, Primitive, RayFlags, Tlas, TlasInstance, TraceRay, TraversalSeeds,
};
use anyhit_engine::geometry::{
    Intersection, ObjectRay, Precision, Ray, Surface, aabb, linear_swept_sphere, sphere, triangle,
};
use pretty_assertions::assert_eq;
use proptest::prelude::*;

/// What happened in a traversal, in order.
#[derive(Clone, Debug, PartialEq)]
enum Event {
    /// A candidate with the t_max that its shader sees.
    Presented(Candidate, f32),
    /// A report in a box and whether it was accepted.
    Reported(f32, bool),
    /// The outcome.
    Committed(Option<(Candidate, f32, HitKind)>),
}

/// What the shaders do, decided by the candidate alone.
#[derive(Clone, Copy, Debug)]
struct Shaders {
    seed: u64,
    /// Of 8 candidates this many are accepted.
    accept_of_8: u64,
    /// Of 8 accepted candidates this many terminate the ray.
    terminate_of_8: u64,
}

impl Shaders {
    fn draw(&self, candidate: &Candidate, salt: u64) -> u64 {
        let name = u64::from(candidate.instance) << 40
            | u64::from(candidate.geometry) << 20
            | u64::from(candidate.primitive);
        let mut x =
            self.seed ^ name.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ salt.wrapping_mul(0xD1B5_4A32_D192_ED03);
        x = (x ^ x >> 31).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x ^ x >> 29
    }

    fn accepts(&self, candidate: &Candidate, salt: u64) -> bool {
        self.draw(candidate, salt) % 8 < self.accept_of_8
    }

    fn terminates(&self, candidate: &Candidate) -> bool {
        self.draw(candidate, 99) % 8 < self.terminate_of_8
    }

    /// The reports of an intersection shader: far before near, some beyond, some twice.
    fn reports(&self, candidate: &Candidate) -> Vec<(f32, HitKind)> {
        let entry = candidate.intersection.t;
        (0..self.draw(candidate, 7) % 4)
            .map(|k| {
                let scale = [1.5f32, 1.0, 1.0, 1.25][(self.draw(candidate, k) % 4) as usize];
                (entry * scale, HitKind(k as u32))
            })
            .collect()
    }
}

/// Runs a new cursor.
fn traverse(tlas: &Tlas, trace: TraceRay, shaders: Shaders) -> Vec<Event> {
    walk(Cursor::new(tlas, trace), tlas, shaders)
}

/// Runs a cursor that has not begun.
fn walk(mut cursor: Cursor, tlas: &Tlas, shaders: Shaders) -> Vec<Event> {
    let mut events = Vec::new();
    while let Some(candidate) = cursor.proceed(tlas) {
        events.push(Event::Presented(candidate, cursor.t_max()));
        if candidate.is_box() {
            for (t, kind) in shaders.reports(&candidate) {
                let accepted = cursor.accepts(t)
                    && (candidate.opaque || shaders.accepts(&candidate, u64::from(kind.0)))
                    && cursor.generate(t, kind);
                events.push(Event::Reported(t, accepted));
                if accepted && !candidate.opaque && shaders.terminates(&candidate) {
                    cursor.terminate();
                    break;
                }
            }
        } else if shaders.accepts(&candidate, 0) {
            assert!(cursor.confirm());
        }
    }
    assert!(cursor.proceed(tlas).is_none());
    events.push(Event::Committed(cursor.committed().map(|c| (c.candidate, c.t, c.hit_kind))));
    events
}

/// The definition.
fn scan(tlas: &Tlas, trace: TraceRay, shaders: Shaders) -> Vec<Event> {
    let mut list = meet_all(tlas, trace);
    let key = |c: &Candidate, t: f32| (t, c.instance, c.geometry, c.primitive);
    list.sort_by(|a, b| key(a, a.intersection.t).partial_cmp(&key(b, b.intersection.t)).unwrap());
    let mut events = Vec::new();
    let mut committed: Option<(Candidate, f32, HitKind)> = None;
    'walk: for candidate in list {
        if committed.is_some_and(|(c, t, _)| key(&c, t) < key(&candidate, candidate.intersection.t)) {
            break;
        }
        let first_hit_ends = trace.flags.0 & 4 != 0;
        if !candidate.is_box() {
            if !candidate.opaque {
                events.push(Event::Presented(candidate, committed.map_or(trace.ray.t_max, |(_, t, _)| t)));
                if !shaders.accepts(&candidate, 0) {
                    continue;
                }
            }
            committed = Some((candidate, candidate.intersection.t, kind_of(&candidate)));
            break;
        }
        events.push(Event::Presented(candidate, committed.map_or(trace.ray.t_max, |(_, t, _)| t)));
        let mut ended = false;
        for (t, kind) in shaders.reports(&candidate) {
            let t_max = committed.map_or(trace.ray.t_max, |(_, t, _)| t);
            let closer = committed.is_none_or(|(c, other, _)| key(&candidate, t) <= key(&c, other));
            let within = trace.ray.t_min <= t && t <= t_max && closer && !ended;
            let accepted = within && (candidate.opaque || shaders.accepts(&candidate, u64::from(kind.0)));
            events.push(Event::Reported(t, accepted));
            if accepted {
                committed = Some((candidate, t, kind));
                ended = first_hit_ends;
                if !candidate.opaque && shaders.terminates(&candidate) {
                    break 'walk;
                }
            }
        }
        if ended {
            break;
        }
    }
    events.push(Event::Committed(committed));
    events
}

fn kind_of(candidate: &Candidate) -> HitKind {
    match candidate.intersection.surface {
        Surface::TriangleFront => HitKind(0xFE),
        Surface::TriangleBack => HitKind(0xFF),
        Surface::Sphere => HitKind::SPHERE,
        Surface::Side | Surface::Cap0 | Surface::Cap1 => HitKind::LINEAR_SWEPT_SPHERE,
        Surface::Aabb => unreachable!("a box has no kind of its own"),
    }
}

/// Every primitive that the ray meets and no rule drops.
fn meet_all(tlas: &Tlas, trace: TraceRay) -> Vec<Candidate> {
    let flags = trace.flags.0;
    let mut list = Vec::new();
    for (number, instance) in tlas.instances().iter().enumerate() {
        if u32::from(instance.mask) & trace.cull_mask & 0xFF == 0 {
            continue;
        }
        let Some(ray) = ObjectRay::new(&trace.ray, Some(&instance.transform)) else { continue };
        for (geometry, Geometry { data, flags: geometry_flags, .. }) in
            instance.blas.geometries().iter().enumerate()
        {
            let is_boxes = matches!(data, GeometryData::Aabbs(_));
            if flags & if is_boxes { 512 } else { 256 } != 0 {
                continue;
            }
            let mut opaque = geometry_flags.0 & 1 != 0;
            match instance.flags.0 & 12 {
                4 => opaque = true,
                8 => opaque = false,
                _ => {}
            }
            if flags & 3 != 0 {
                opaque = flags & 1 != 0;
            }
            if flags & if opaque { 64 } else { 128 } != 0 {
                continue;
            }
            for primitive in 0..data.primitive_count() as u32 {
                let Some(found) = meet(&ray, data.primitive(primitive)) else { continue };
                let mut surface = found.surface;
                if instance.flags.0 & 2 != 0 {
                    surface = match surface {
                        Surface::TriangleFront => Surface::TriangleBack,
                        Surface::TriangleBack => Surface::TriangleFront,
                        other => other,
                    };
                }
                let culls = instance.flags.0 & 1 == 0;
                if culls && surface == Surface::TriangleBack && flags & 16 != 0
                    || culls && surface == Surface::TriangleFront && flags & 32 != 0
                {
                    continue;
                }
                list.push(Candidate {
                    instance: number as u32,
                    geometry: geometry as u32,
                    primitive,
                    intersection: Intersection { surface, ..found },
                    opaque,
                });
            }
        }
    }
    list
}

fn meet(ray: &ObjectRay, primitive: Primitive) -> Option<Intersection> {
    let exact = Precision::Exact;
    match primitive {
        Primitive::Triangle(vertices) => triangle::intersect(ray, vertices, exact),
        Primitive::Aabb([a, b, c, d, e, f]) => aabb::intersect(ray, [a, b, c], [d, e, f], exact),
        Primitive::Sphere { position, radius } => sphere::intersect(ray, position, radius, exact),
        Primitive::LinearSweptSphere { positions, radii, caps } => {
            linear_swept_sphere::intersect(ray, positions, radii, caps, exact)
        }
    }
}

/// A small generator, so that one seed gives one scene.
struct Draw(u64);

impl Draw {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    /// From -1 to 1, mostly coarse so that rays meet faces, edges and ties.
    fn unit(&mut self) -> f32 {
        match self.below(3) {
            0 => self.below(9) as f32 / 4.0 - 1.0,
            1 => self.below(33) as f32 / 16.0 - 1.0,
            _ => self.bits() as f32 / (1u64 << 30) as f32 - 1.0,
        }
    }

    fn point(&mut self, scale: f32) -> [f32; 3] {
        [(); 3].map(|()| self.unit() * scale)
    }

    fn data(&mut self, kind: u64, scale: f32, count: usize) -> GeometryData {
        let near = |draw: &mut Self, at: [f32; 3]| {
            let by = draw.point(0.75 * scale);
            std::array::from_fn(|k| at[k] + by[k])
        };
        let points = |draw: &mut Self, n: usize| (0..n).map(|_| draw.point(scale)).collect::<Vec<_>>();
        let radii = |draw: &mut Self, n: usize| {
            (0..n)
                .map(|_| if draw.below(20) == 0 { f32::NAN } else { draw.unit().abs() * 0.5 * scale })
                .collect::<Vec<f32>>()
        };
        match kind {
            0 => {
                let mut vertices = Vec::new();
                for _ in 0..count {
                    let at = self.point(scale);
                    vertices.extend([at, near(self, at), near(self, at)]);
                }
                GeometryData::Triangles { vertices, indices: None, transform: None }
            }
            1 => GeometryData::Aabbs(
                (0..count)
                    .map(|_| {
                        let a = self.point(scale);
                        let b: [f32; 3] = near(self, a);
                        let low = |k: usize| a[k].min(b[k]);
                        let high = |k: usize| a[k].max(b[k]);
                        [low(0), low(1), low(2), high(0), high(1), high(2)]
                    })
                    .collect(),
            ),
            2 => {
                let positions = points(self, count);
                let radii = radii(self, count);
                GeometryData::Spheres { positions, radii, indices: None }
            }
            _ => {
                let mut positions = points(self, 1);
                while positions.len() <= count {
                    let last = positions[positions.len() - 1];
                    positions.push(near(self, last));
                }
                // Thin ones stand in several leaves.
                let thin = [1.0, 0.01][self.below(2) as usize];
                let radii = radii(self, count + 1).into_iter().map(|radius: f32| radius * thin).collect();
                let indices = (0..count as u32).map(|k| if self.below(9) == 0 { k / 2 } else { k }).collect();
                GeometryData::LinearSweptSpheres {
                    positions,
                    radii,
                    indices: Some(indices),
                    indexing: Indexing::Successive,
                    end_caps: EndCaps::Chained,
                }
            }
        }
    }

    fn blas(&mut self, scale: f32) -> Arc<Blas> {
        let kind = self.below(4);
        let geometries = (0..1 + self.below(3))
            .map(|_| {
                let count = [0, 1, 3, 9, 40, 150][self.below(6) as usize];
                Geometry::new(self.data(kind, scale, count), GeometryFlags(self.below(4) as u32))
            })
            .collect();
        Blas::new(geometries).unwrap()
    }

    fn transform(&mut self, scale: f32) -> [[f32; 4]; 3] {
        let mut m = [[0.0; 4]; 3];
        match self.below(4) {
            0 => {
                for (k, row) in m.iter_mut().enumerate() {
                    row[k] = 1.0;
                }
                return m;
            }
            // Permuted axes with signs: axis-parallel rays stay so.
            1 => {
                let turn = self.below(3) as usize;
                for (k, row) in m.iter_mut().enumerate() {
                    row[(k + turn) % 3] = [1.0, -1.0, 2.0, 0.5][self.below(4) as usize];
                }
            }
            _ => {
                for (k, row) in m.iter_mut().enumerate() {
                    let [x, y, z] = self.point(0.5);
                    (row[0], row[1], row[2]) = (x, y, z);
                    row[k] += 1.5;
                }
            }
        }
        for row in &mut m {
            row[3] = self.unit() * scale;
        }
        m
    }

    /// Nothing in it asks a shader.
    fn plain_blas(&mut self, scale: f32) -> Arc<Blas> {
        let kind = [0, 2, 3][self.below(3) as usize];
        let count = [1, 9, 150][self.below(3) as usize];
        Blas::new(vec![Geometry::new(self.data(kind, scale, count), GeometryFlags::OPAQUE)]).unwrap()
    }

    /// So many that the first rays look through all of them.
    fn great_blas(&mut self, scale: f32) -> Arc<Blas> {
        let kind = self.below(4);
        let flags = GeometryFlags(self.below(4) as u32);
        Blas::new(vec![Geometry::new(self.data(kind, scale, 600), flags)]).unwrap()
    }

    fn tlas(&mut self, scale: f32, blas: impl Fn(&mut Self, f32) -> Arc<Blas>) -> Arc<Tlas> {
        let count = [1, 2, 4, 5, 30][self.below(5) as usize];
        let shared: Vec<_> = (0..3).map(|_| blas(self, scale)).collect();
        let mut transform = self.transform(scale);
        let instances = (0..count)
            .map(|_| {
                let blas = shared[self.below(3) as usize].clone();
                // One in four lies where the one before lies: equal t, told apart by instance only.
                if self.below(4) != 0 {
                    transform = self.transform(scale);
                }
                TlasInstance {
                    mask: [0xFF, 0xFF, 0x0F, 0][self.below(4) as usize],
                    flags: InstanceFlags([0, 0, 1, 2, 3, 4, 8][self.below(7) as usize]),
                    ..TlasInstance::of(blas, transform)
                }
            })
            .collect();
        Tlas::new(instances).unwrap()
    }

    fn trace(&mut self, scale: f32) -> TraceRay {
        let distance = [0.5, 1.0, 3.0, 3.0, 1e3, 1e9][self.below(6) as usize];
        let length = [1.0f32, 1.0, 1e-3, 1e5][self.below(4) as usize];
        let target = self.point(scale);
        let mut origin = self.point(scale * distance);
        // Half of the rays run along an axis, half of the others keep one component zero.
        match self.below(4) {
            0 | 1 => {
                let axis = self.below(3) as usize;
                let along = origin[axis];
                origin = target;
                origin[axis] = along;
            }
            2 => {
                let axis = self.below(3) as usize;
                origin[axis] = target[axis];
            }
            _ => {}
        }
        let direction: [f32; 3] = std::array::from_fn(|k| (target[k] - origin[k]) * (length / distance));
        let t_min = [0.0, 0.0, 0.1][self.below(3) as usize];
        let t_max = [f32::INFINITY, f32::INFINITY, 1e5, 0.5][self.below(4) as usize];
        let opacity = [0, 0, 0, 1, 2, 64, 128][self.below(7) as usize];
        let sides = [0, 0, 0, 16, 32, 256, 512][self.below(7) as usize];
        let first = [0, 0, 4][self.below(3) as usize];
        TraceRay {
            ray: Ray::new(origin, direction).with_interval(t_min, t_max),
            flags: RayFlags(opacity | sides | first),
            cull_mask: [0xFF, 0xFF, 0xF0, 0xFFFF_FF01][self.below(4) as usize],
            time: 0.0,
        }
    }

    fn shaders(&mut self) -> Shaders {
        Shaders {
            seed: self.bits(),
            accept_of_8: [0, 2, 6, 8][self.below(4) as usize],
            terminate_of_8: [0, 0, 2][self.below(3) as usize],
        }
    }
}

fn compare(seed: u64, scale: f32, rays: usize) -> usize {
    compare_in(seed, scale, rays, Draw::blas)
}

fn compare_in(seed: u64, scale: f32, rays: usize, blas: impl Fn(&mut Draw, f32) -> Arc<Blas>) -> usize {
    let mut draw = Draw(seed);
    let tlas = draw.tlas(scale, blas);
    let mut met = 0;
    for _ in 0..rays {
        let trace = draw.trace(scale);
        let shaders = draw.shaders();
        let expected = scan(&tlas, trace, shaders);
        met += usize::from(expected.len() > 1 || expected[0] != Event::Committed(None));
        assert_eq!(traverse(&tlas, trace, shaders), expected, "seed {seed}, scale {scale:e}, {trace:?}");
        // All opaque and no boxes: no shader decides, and whether anything is hit is all that is
        // asked.
        let flags = RayFlags(trace.flags.0 & !0x2C3 | 0x201);
        let plain = TraceRay { flags, ..trace };
        let mut any = Cursor::new(&tlas, plain);
        any.end_at_any_opaque_hit();
        assert!(any.proceed(&tlas).is_none());
        let closest = matches!(traverse(&tlas, plain, shaders)[..], [Event::Committed(Some(_))]);
        assert_eq!(any.committed().is_some(), closest, "seed {seed}, scale {scale:e}, {plain:?}");
    }
    met
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]
    #[test]
    fn a_few_rays_without_a_tree_walk_the_same_list(seed in any::<u64>()) {
        compare_in(seed, 1.0, 12, Draw::great_blas);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn the_cursor_walks_the_sorted_list(seed in any::<u64>()) {
        compare(seed, 1.0, 20);
    }

    #[test]
    fn without_shaders_the_closest_is_committed(seed in any::<u64>(), exponent in prop_oneof![Just(0i32), -30i32..30]) {
        compare_in(seed, 10f32.powi(exponent), 20, Draw::plain_blas);
    }

    #[test]
    fn scale_changes_nothing(seed in any::<u64>(), exponent in -30i32..30) {
        compare(seed, 10f32.powi(exponent), 10);
    }
}

proptest! {
    /// Where the shaders decide by the candidate alone and end no ray, the closest hit does not
    /// depend on the order in which the hits come, nor on how often; at equal t it does where ties
    /// are drawn. No candidate comes that lies behind the closest hit so far.
    #[test]
    fn a_drawn_order_has_the_same_closest_hit(seed in any::<u64>(), drawn in any::<[Option<u64>; 3]>()) {
        let [any_hit_order, any_hit_duplicates, ties] = drawn;
        // These shaders report hits in boxes that the ray misses, too.
        let intersection_repeats = None;
        let seeds = TraversalSeeds { any_hit_order, any_hit_duplicates, intersection_repeats, ties };
        let mut draw = Draw(seed);
        let tlas = draw.tlas(1.0, Draw::blas);
        for _ in 0..8 {
            let trace = draw.trace(1.0);
            let trace = TraceRay { flags: RayFlags(trace.flags.0 & !4), ..trace };
            let shaders = Shaders { terminate_of_8: 0, ..draw.shaders() };
            let wanted = traverse(&tlas, trace, shaders);
            let mut cursor = Cursor::new(&tlas, trace);
            cursor.draw(&tlas, seeds);
            let found = walk(cursor, &tlas, shaders);
            match (wanted.last(), found.last(), ties) {
                (Some(Event::Committed(Some((_, wanted, _)))), Some(Event::Committed(Some((_, found, _)))), Some(_)) => {
                    prop_assert_eq!(wanted, found);
                }
                (wanted, found, _) => prop_assert_eq!(wanted, found),
            }
            for event in &found {
                if let Event::Presented(candidate, t_max) = event {
                    prop_assert!(candidate.intersection.t <= *t_max);
                }
            }
        }
    }
}

/// Three triangles one behind the other come in all six orders, and twice unless a flag forbids it.
#[test]
fn every_order_is_drawn() {
    let triangle = |z: f32| [[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]];
    let data = || GeometryData::Triangles {
        vertices: [1.0, 2.0, 3.0].map(triangle).concat(),
        indices: None,
        transform: None,
    };
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let trace = TraceRay { ray, flags: RayFlags(0), cull_mask: 0xFF, time: 0.0 };
    let orders = |flags, seeds: &dyn Fn(u64) -> TraversalSeeds| {
        let blas = Blas::new(vec![Geometry::new(data(), flags)]).unwrap();
        let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let tlas = Tlas::new(vec![TlasInstance::of(blas, identity)]).unwrap();
        let order = |seed| {
            let mut cursor = Cursor::new(&tlas, trace);
            cursor.draw(&tlas, seeds(seed));
            std::iter::from_fn(|| cursor.proceed(&tlas)).map(|one| one.primitive).collect::<Vec<_>>()
        };
        (0..200).map(order).collect::<std::collections::BTreeSet<_>>()
    };
    let order = |seed| TraversalSeeds { any_hit_order: Some(seed), ..TraversalSeeds::default() };
    assert_eq!(orders(GeometryFlags(0), &order).len(), 6);
    let duplicates = |seed| TraversalSeeds { any_hit_duplicates: Some(seed), ..TraversalSeeds::default() };
    // Each of the three once or twice.
    assert_eq!(orders(GeometryFlags(0), &duplicates).len(), 8);
    assert_eq!(orders(GeometryFlags::NO_DUPLICATE_ANY_HIT, &duplicates).len(), 1);
}

/// The comparison with the sorted list compares something.
#[test]
fn random_rays_meet_things() {
    let met: usize = (0..50).map(|seed| compare(seed, 1.0, 20)).sum();
    assert!(met > 300, "{met} of 1000 rays met something");
}
