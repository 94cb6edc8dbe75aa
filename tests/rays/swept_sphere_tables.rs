//! Linear swept spheres and spheres as two public suites expect them: which of a few rays hit, by
//! indexing and cap mode. The counts follow from the geometry: a ray down through a point hits
//! where the point lies within a swept sphere's outline that its caps leave in place.

use std::sync::Arc;

use anyhit_engine::accel::{
    Blas, Committed, Cursor, EndCaps, Geometry, GeometryData, GeometryFlags, HitKind, Indexing, RayFlags,
    Tlas, TlasInstance, TraceRay,
};
use anyhit_engine::geometry::{Ray, Surface};

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

fn scene(data: GeometryData) -> Arc<Tlas> {
    let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)]).unwrap();
    Tlas::new(vec![TlasInstance::of(blas, IDENTITY)]).unwrap()
}

fn trace(tlas: &Tlas, origin: [f32; 3], direction: [f32; 3]) -> Option<Committed> {
    let ray = Ray::new(origin, direction).with_interval(0.001, 1000.0);
    let mut cursor = Cursor::new(tlas, TraceRay { ray, flags: RayFlags::OPAQUE, cull_mask: 0xFF, time: 0.0 });
    assert_eq!(cursor.proceed(tlas), None, "opaque primitives commit silently");
    cursor.committed().copied()
}

fn swept(
    positions: &[[f32; 3]],
    radius: f32,
    indices: Option<Vec<u32>>,
    indexing: Indexing,
    end_caps: EndCaps,
) -> Arc<Tlas> {
    scene(GeometryData::LinearSweptSpheres {
        positions: positions.to_vec(),
        radii: vec![radius; positions.len()],
        indices,
        indexing,
        end_caps,
    })
}

/// Three points in a row at x = 2, 6, 10 with radius 2, seen from above at x = 1, 4, 7, 9, 11: x =
/// 1 and x = 11 lie beyond the end points, over caps only.
#[test]
fn without_caps_only_the_sides_are_hit() {
    let points = [[2.0, 0.0, 0.0], [6.0, 0.0, 0.0], [10.0, 0.0, 0.0]];
    let hits = |tlas: &Tlas| {
        [1.0, 4.0, 7.0, 9.0, 11.0].map(|x| trace(tlas, [x, 0.0, 5.0], [0.0, 0.0, -1.0]).is_some())
    };
    // The list pairs the first two points and ignores the third.
    let list = swept(&points, 2.0, None, Indexing::List, EndCaps::None);
    assert_eq!(hits(&list), [false, true, false, false, false]);
    let row = |caps| swept(&points, 2.0, Some(vec![0, 1]), Indexing::Successive, caps);
    assert_eq!(hits(&row(EndCaps::None)), [false, true, true, true, false]);
    assert_eq!(hits(&row(EndCaps::Chained)), [true; 5]);
}

/// Radius 2 on a row: the joint of a chain belongs to the segment that ends there, and is met there
/// with u = 1.
#[test]
fn a_joint_belongs_to_the_segment_before_it() {
    // A corner at the origin: a ray onto its outer side meets only the sphere of the joint.
    let points = [[-4.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -4.0, 0.0]];
    let tlas = swept(&points, 1.0, Some(vec![0, 1]), Indexing::Successive, EndCaps::Chained);
    // At (1/2, 1/2) both segments lie behind their ends; the sphere's top is at sqrt(1 - 1/2).
    let hit = trace(&tlas, [0.5, 0.5, 8.0], [0.0, 0.0, -1.0]).expect("the joint's cap");
    assert_eq!((hit.candidate.primitive, hit.candidate.intersection.surface), (0, Surface::Cap1));
    assert_eq!(hit.candidate.intersection.attributes, [1.0, 0.0]);
    assert_eq!(hit.t, (8.0 - 0.5f64.sqrt()) as f32);
    assert_eq!(hit.hit_kind, HitKind::LINEAR_SWEPT_SPHERE);
    // As a list of pairs the same joint is owned twice: the lower primitive wins the tie.
    let list = swept(&points, 1.0, Some(vec![0, 1, 1, 2]), Indexing::List, EndCaps::Chained);
    let tied = trace(&list, [0.5, 0.5, 8.0], [0.0, 0.0, -1.0]).expect("either cap");
    assert_eq!((tied.candidate.primitive, tied.t), (0, hit.t));
    // Apart, in successive mode, the second starts a chain of its own.
    let apart = swept(&points, 1.0, Some(vec![1, 0]), Indexing::Successive, EndCaps::Chained);
    let first = trace(&apart, [0.5, 0.5, 8.0], [0.0, 0.0, -1.0]).expect("a leading cap");
    assert_eq!((first.candidate.primitive, first.candidate.intersection.surface), (0, Surface::Cap0));
}

/// slang-rhi's chain (-.5,-.5,3) (0,.5,3) (.5,-.5,3) of radius .2 under 128 x 128 parallel rays,
/// here through the pixels' lower corners: (96, 32) is the chain's end, met by the trailing cap, u
/// = 1.
#[test]
fn the_chain_of_slang_rhi() {
    let points = [[-0.5, -0.5, 3.0], [0.0, 0.5, 3.0], [0.5, -0.5, 3.0]];
    let tlas = swept(&points, 0.2, Some(vec![0, 1]), Indexing::Successive, EndCaps::Chained);
    let pixel = |x: u32, y: u32| {
        let at = |k: u32| k as f32 / 64.0 - 1.0;
        trace(&tlas, [at(x), at(y), 0.0], [0.0, 0.0, 1.0])
    };
    assert_eq!(pixel(32, 32).expect("first segment").candidate.primitive, 0);
    let last = pixel(96, 32).expect("second segment");
    assert_eq!((last.candidate.primitive, last.candidate.intersection.attributes[0]), (1, 1.0));
    for (x, y) in [(64, 32), (0, 0), (127, 0), (0, 127), (127, 127)] {
        assert_eq!(pixel(x, y), None, "({x}, {y})");
    }
}

/// slang-rhi's three spheres, and the same chosen by indices.
#[test]
fn spheres_are_numbered_by_primitive() {
    let positions = vec![[-0.5, -0.5, 3.0], [0.5, -0.5, 3.0], [0.0, 0.5, 3.0]];
    let radii = vec![0.4, 0.2, 0.6];
    let all = |indices| {
        scene(GeometryData::Spheres { positions: positions.clone(), radii: radii.clone(), indices })
    };
    let seen = |tlas: &Tlas| {
        [(32, 32), (96, 32), (64, 96)].map(|(x, y)| {
            let at = |k: i32| (k as f32 + 0.5) / 64.0 - 1.0;
            trace(tlas, [at(x), at(y), 0.0], [0.0, 0.0, 1.0]).map(|hit| hit.candidate.primitive)
        })
    };
    assert_eq!(seen(&all(None)), [Some(0), Some(1), Some(2)]);
    assert_eq!(seen(&all(Some(vec![2, 0]))), [Some(1), None, Some(0)]);
    let hit = trace(&all(None), [-0.5, -0.5, 0.0], [0.0, 0.0, 1.0]).expect("the first");
    assert_eq!((hit.hit_kind, hit.candidate.intersection.attributes), (HitKind::SPHERE, [0.0; 2]));
}

/// A ray that starts inside meets nothing of it, on the way out neither; a box is met at t_min.
#[test]
fn a_start_inside_is_no_hit_but_in_a_box() {
    let capsule = swept(&[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], 1.0, None, Indexing::List, EndCaps::Chained);
    assert_eq!(trace(&capsule, [0.0; 3], [0.0, 0.0, 1.0]), None);
    let sphere = scene(GeometryData::Spheres { positions: vec![[0.0; 3]], radii: vec![1.0], indices: None });
    assert_eq!(trace(&sphere, [0.0; 3], [0.0, 0.0, 1.0]), None);
    let aabb = scene(GeometryData::Aabbs(vec![[-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]]));
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]).with_interval(0.25, 10.0);
    let mut cursor =
        Cursor::new(&aabb, TraceRay { ray, flags: RayFlags::default(), cull_mask: 1, time: 0.0 });
    assert_eq!(cursor.proceed(&aabb).map(|candidate| candidate.intersection.t), Some(0.25));
}
