//! The quality of our BVH beside that of the crate obvhs, in counts that no other load changes:
//! nodes opened and primitives tested for a ray.
//!
//! obvhs builds a binary tree by PLOC and reinsertion. Its nodes are gathered here into wide ones
//! of eight children and leaves of up to four primitives, at the least cost that our builder's
//! costs allow (the dynamic programming of Ylitie, Karras and Laine, *Efficient Incoherent Ray
//! Traversal on GPUs Through Compressed Wide BVHs*, 2017), and traversed in our order: children by
//! entry, each culled by the closest hit so far. Primitives are tested exactly in both.

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use anyhit_engine::accel::{Counters, Cursor, GeometryFlags, Primitive, RayFlags, Tlas, TraceRay};
use anyhit_engine::geometry::{
    Bounds, Intersection, ObjectRay, Precision, Ray, aabb, linear_swept_sphere, sphere, triangle,
};

use crate::scenes::{self, Scene};
use crate::table::Table;

const WIDTH: usize = 8;
const MAX_LEAF_SIZE: u32 = 4;

/// The costs of our builder in units of a node's test: of a leaf, of a primitive in it, and the
/// share of a leaf's cost below which it is divided.
#[derive(Clone, Copy)]
struct Cost {
    leaf: f32,
    primitive: f32,
    split_below: f32,
}

const SPHERES: Cost = Cost { leaf: 1.0, primitive: 0.15, split_below: 1.0 };
const TRIANGLES: Cost = Cost { leaf: 1.0, primitive: 0.05, split_below: 0.8 };
const SWEPT_SPHERES: Cost = Cost { leaf: 1.5, primitive: 0.2, split_below: 0.8 };

/// Prints a row for each scene and builder.
pub fn run(table: &Table) {
    let (grid, many, blades) = (table.size(256, 8), table.size(10_000, 50), table.size(30_000, 50));
    let scenes: [(&str, &dyn Fn() -> Scene, Cost); 4] = [
        ("builders triangles", &|| scenes::heightfield(grid), TRIANGLES),
        ("builders splinters", &|| scenes::splinters(blades), TRIANGLES),
        ("builders spheres", &|| scenes::spheres(many), SPHERES),
        ("builders swept spheres", &|| scenes::meadow(blades), SWEPT_SPHERES),
    ];
    for (name, make, cost) in scenes {
        if table.wants(name) {
            compare(name, &make(), cost, table.picture);
        }
    }
}

fn compare(name: &str, scene: &Scene, cost: Cost, picture: [u32; 2]) {
    let rays = scene.camera.rays(picture);
    let row = |builder: &str, counts: Counts| {
        let each = |count: u64| count as f64 / rays.len() as f64;
        println!(
            "{name:<24} {builder:<22} {:>6.2} nodes {:>6.2} tests a ray   {} hits",
            each(counts.nodes),
            each(counts.tests),
            counts.hits
        );
        counts
    };
    let tlas = scene.tlas(GeometryFlags::OPAQUE);
    let own = row("binned SAH", own_counts(&tlas, &rays));
    let primitives: Vec<Primitive> =
        (0..scene.data.primitive_count() as u32).map(|at| scene.data.primitive(at)).collect();
    let aabbs: Vec<Aabb> = primitives.iter().map(aabb_of).collect();
    for (builder, distance, ratio) in [
        ("PLOC", PlocSearchDistance::Medium, 0.0),
        ("PLOC, 5 % reinserted", PlocSearchDistance::Medium, 0.05),
        ("PLOC, all reinserted", PlocSearchDistance::High, 1.0),
    ] {
        let numbers = (0..aabbs.len() as u32).collect();
        let mut bvh = PlocBuilder::new().build(distance, &aabbs, numbers, SortPrecision::U64, 0);
        ReinsertionOptimizer::default().run(&mut bvh, ratio, None);
        let tree = WideTree::new(&bvh, cost);
        let mut counts = Counts::default();
        rays.iter().for_each(|ray| tree.trace(ray, &primitives, &mut counts));
        let counts = row(builder, counts);
        assert_eq!(counts.hits, own.hits, "{name}, {builder}: other hits");
    }
}

/// The work of all rays.
#[derive(Clone, Copy, Default)]
struct Counts {
    nodes: u64,
    tests: u64,
    hits: u64,
}

/// The work of a cursor.
fn own_counts(tlas: &Tlas, rays: &[Ray]) -> Counts {
    let trace = |ray: &Ray| TraceRay { ray: *ray, flags: RayFlags::OPAQUE, cull_mask: 0xFF, time: 0.0 };
    // The first rays test a list instead.
    let mut cursor = Cursor::new(tlas, trace(&rays[0]));
    for _ in 0..8 {
        cursor.reset(tlas, trace(&rays[rays.len() / 2]));
        while cursor.proceed(tlas).is_some() {}
    }
    let mut counters = Counters::default();
    let mut hits = 0;
    for ray in rays {
        cursor.reset(tlas, trace(ray));
        while cursor.proceed_observed(tlas, &mut counters).is_some() {}
        hits += u64::from(cursor.committed().is_some());
    }
    Counts { nodes: counters.nodes, tests: counters.primitives, hits }
}

fn aabb_of(primitive: &Primitive) -> Aabb {
    let bounds = match *primitive {
        Primitive::Triangle(vertices) => triangle::bounds(vertices),
        Primitive::Aabb([a, b, c, d, e, f]) => aabb::bounds([a, b, c], [d, e, f]),
        Primitive::Sphere { position, radius } => sphere::bounds(position, radius),
        Primitive::LinearSweptSphere { positions, radii, .. } => {
            linear_swept_sphere::bounds(positions, radii)
        }
    };
    let Bounds { min, max } = bounds.expect("a primitive that can be hit");
    Aabb::new(Vec3A::from_array(min), Vec3A::from_array(max))
}

fn intersect(primitive: &Primitive, ray: &ObjectRay) -> Option<Intersection> {
    let precision = Precision::Exact;
    match *primitive {
        Primitive::Triangle(vertices) => triangle::intersect(ray, vertices, precision),
        Primitive::Aabb([a, b, c, d, e, f]) => aabb::intersect(ray, [a, b, c], [d, e, f], precision),
        Primitive::Sphere { position, radius } => sphere::intersect(ray, position, radius, precision),
        Primitive::LinearSweptSphere { positions, radii, caps } => {
            linear_swept_sphere::intersect(ray, positions, radii, caps, precision)
        }
    }
}

/// What becomes of a node of the binary tree that takes some slots of a wide node.
#[derive(Clone, Copy)]
enum Choice {
    /// A leaf of all its primitives.
    Leaf,
    /// A wide node.
    Inner,
    /// What it is with one slot less.
    Fewer,
    /// Its children take the slots, so many of them the left one.
    Split(usize),
}

/// A wide tree whose nodes name nodes of a binary tree.
struct WideTree<'a> {
    bvh: &'a Bvh2,
    /// By node of the binary tree: the children of the wide node that it is, if it is one.
    children: Vec<Vec<usize>>,
    /// By node of the binary tree: the primitives of the leaf that it is, if it is one.
    leaves: Vec<Vec<u32>>,
}

/// The least costs of the subtrees, by the number of slots, less one, of the wide node above.
struct Costs {
    cost: [f32; WIDTH],
    choice: [Choice; WIDTH],
    /// The slots of the left child where this is a wide node.
    left: usize,
    count: u32,
}

impl<'a> WideTree<'a> {
    fn new(bvh: &'a Bvh2, cost: Cost) -> Self {
        let mut order = Vec::new();
        let mut open = vec![0];
        while let Some(at) = open.pop() {
            order.push(at);
            let node = &bvh.nodes[at];
            let first = node.first_index as usize;
            open.extend(if node.is_leaf() { 0..0 } else { first..first + 2 });
        }
        let mut costs: Vec<Option<Costs>> = bvh.nodes.iter().map(|_| None).collect();
        for &at in order.iter().rev() {
            costs[at] = Some(least_costs(bvh, at, &costs, cost));
        }
        let costs: Vec<Costs> = costs.into_iter().map(|one| one.expect("a node below the root")).collect();
        let mut tree =
            Self { bvh, children: vec![Vec::new(); costs.len()], leaves: vec![Vec::new(); costs.len()] };
        let mut open = vec![0];
        while let Some(at) = open.pop() {
            if matches!(costs[at].choice[0], Choice::Leaf) {
                tree.leaves[at] = tree.primitives(at);
                continue;
            }
            let first = bvh.nodes[at].first_index as usize;
            let mut children = Vec::new();
            gather(bvh, &costs, first, costs[at].left, &mut children);
            gather(bvh, &costs, first + 1, WIDTH - costs[at].left, &mut children);
            open.extend(&children);
            tree.children[at] = children;
        }
        tree
    }

    fn primitives(&self, at: usize) -> Vec<u32> {
        let node = &self.bvh.nodes[at];
        let first = node.first_index as usize;
        if node.is_leaf() {
            return self.bvh.primitive_indices[first..first + node.prim_count as usize].to_vec();
        }
        [self.primitives(first), self.primitives(first + 1)].concat()
    }

    /// Finds the closest hit.
    fn trace(&self, ray: &Ray, primitives: &[Primitive], counts: &mut Counts) {
        let object_ray = ObjectRay::in_world(ray).expect("a direction");
        let mut closest = f32::INFINITY;
        let mut open = vec![(0.0, 0)];
        while let Some((near, at)) = open.pop() {
            if near > closest {
                continue;
            }
            for &primitive in &self.leaves[at] {
                counts.tests += 1;
                if let Some(found) = intersect(&primitives[primitive as usize], &object_ray) {
                    closest = closest.min(found.t);
                }
            }
            if self.children[at].is_empty() {
                continue;
            }
            counts.nodes += 1;
            let before = open.len();
            let entered = |&child: &usize| Some((entry(ray, self.bvh.nodes[child].aabb(), closest)?, child));
            open.extend(self.children[at].iter().filter_map(entered));
            open[before..].sort_by(|a, b| b.0.total_cmp(&a.0));
        }
        counts.hits += u64::from(closest < f32::INFINITY);
    }
}

/// The children of a wide node that a node of the binary tree makes of its slots.
fn gather(bvh: &Bvh2, costs: &[Costs], at: usize, slots: usize, children: &mut Vec<usize>) {
    match costs[at].choice[slots - 1] {
        Choice::Leaf | Choice::Inner => children.push(at),
        Choice::Fewer => gather(bvh, costs, at, slots - 1, children),
        Choice::Split(left) => {
            let first = bvh.nodes[at].first_index as usize;
            gather(bvh, costs, first, left, children);
            gather(bvh, costs, first + 1, slots - left, children);
        }
    }
}

/// The least costs of a node, given those of its children.
fn least_costs(bvh: &Bvh2, at: usize, costs: &[Option<Costs>], cost: Cost) -> Costs {
    let node = &bvh.nodes[at];
    let area = node.aabb().half_area();
    let leaf = |count: u32| area * (cost.leaf + count as f32 * cost.primitive);
    let first = node.first_index as usize;
    if node.is_leaf() {
        let mut choice = [Choice::Fewer; WIDTH];
        choice[0] = Choice::Leaf;
        return Costs { cost: [leaf(node.prim_count); WIDTH], choice, left: 0, count: node.prim_count };
    }
    let [left, right] = [first, first + 1].map(|child| costs[child].as_ref().expect("children come first"));
    let split = |slots: usize| {
        let with = |k: usize| (left.cost[k - 1] + right.cost[slots - k - 1], k);
        (1..slots).map(with).fold((f32::INFINITY, 1), |best, one| if one.0 < best.0 { one } else { best })
    };
    let (inner, slots_of_left) = split(WIDTH);
    let count = left.count + right.count;
    let mut one = (inner + area, Choice::Inner);
    if count <= MAX_LEAF_SIZE && leaf(count) <= one.0 {
        one = (leaf(count), Choice::Leaf);
    }
    let share = if matches!(one.1, Choice::Leaf) { cost.split_below } else { 1.0 };
    let mut all = Costs { cost: [one.0; WIDTH], choice: [one.1; WIDTH], left: slots_of_left, count };
    for slots in 2..=WIDTH {
        let (apart, k) = split(slots);
        let fewer = all.cost[slots - 2];
        (all.cost[slots - 1], all.choice[slots - 1]) =
            if apart < share * fewer { (apart, Choice::Split(k)) } else { (fewer, Choice::Fewer) };
    }
    all
}

/// Where a ray enters a box, within its interval.
fn entry(ray: &Ray, aabb: &Aabb, closest: f32) -> Option<f32> {
    let (mut near, mut far) = (f64::from(ray.t_min), f64::from(closest));
    for axis in 0..3 {
        let (origin, direction) = (f64::from(ray.origin[axis]), f64::from(ray.direction[axis]));
        let times = [aabb.min[axis], aabb.max[axis]].map(|side| (f64::from(side) - origin) / direction);
        near = near.max(times[0].min(times[1]));
        far = far.min(times[0].max(times[1]));
    }
    // A hit is not lost to the rounding of t.
    (near * (1.0 - 1e-6) <= far).then_some((near * (1.0 - 1e-6)) as f32)
}
