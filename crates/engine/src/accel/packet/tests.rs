//! Rays that are traced as a packet find the hits that each finds alone.

use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use crate::accel::{
    Blas, Counters, EndCaps, Geometry, GeometryData, GeometryFlags, Indexing, InstanceFlags, LookAhead,
    RayFlags, TlasInstance,
};
use crate::geometry::{Precision, Ray};
use crate::math::baseline_simd::BaselineSimd;
use crate::math::lane_ops::LaneOps;

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

fn traced_singly(tlas: &Tlas, trace: &TraceRay) -> Option<Committed> {
    let mut cursor = Cursor::new(tlas, *trace);
    assert!(cursor.proceed(tlas).is_none(), "no shader decides");
    cursor.committed().copied()
}

/// Compares each ray's hit with the one that a cursor finds, with and without AVX2.
fn check(tlas: &Tlas, traces: &[TraceRay]) {
    let wanted: Vec<_> = traces.iter().map(|trace| traced_singly(tlas, trace)).collect();
    let mut hits = Vec::new();
    assert!(Packet::default().trace(tlas, traces, false, &mut hits));
    assert_eq!(hits, wanted);
    assert!(Packet::default().trace(tlas, traces, true, &mut hits));
    let whether = |hits: &[Option<Committed>]| hits.iter().map(Option::is_some).collect::<Vec<_>>();
    assert_eq!(whether(&hits), whether(&wanted));
    if let Some(first) = traces.get(..MAX_RAYS.min(traces.len())).filter(|first| !first.is_empty()) {
        let mut packet = Packet { steps: u32::MAX, single_steps: u32::MAX, ..Packet::default() };
        let traversal = PacketTraversal {
            packet: &mut packet,
            tlas,
            traces: first,
            any_opaque_hit: false,
            behind: &[],
            single_ray_mask: 0,
        };
        let left = BaselineSimd.dispatch(traversal);
        for (at, wanted) in wanted.iter().enumerate().take(first.len()) {
            if left >> at & 1 == 0 {
                assert_eq!(packet.committed(tlas, at), *wanted, "ray {at}");
            }
        }
    }
}

/// Points of a coarse grid, so that edges, vertices and equal t are met.
fn point() -> impl Strategy<Value = [f32; 3]> {
    prop::array::uniform3((-8i32..=8).prop_map(|k| k as f32 * 0.5))
}

fn data() -> impl Strategy<Value = GeometryData> {
    let radius = (1i32..=8).prop_map(|k| k as f32 * 0.125);
    prop_oneof![
        prop::collection::vec(point(), 3..90).prop_map(|mut vertices| {
            vertices.truncate(vertices.len() / 3 * 3);
            GeometryData::Triangles { vertices, indices: None, transform: None }
        }),
        prop::collection::vec((point(), radius.clone()), 1..40).prop_map(|all| {
            let (positions, radii) = all.into_iter().unzip();
            GeometryData::Spheres { positions, radii, indices: None }
        }),
        prop::collection::vec((point(), radius), 2..40).prop_map(|mut all| {
            all.truncate(all.len() / 2 * 2);
            let (positions, radii) = all.into_iter().unzip();
            let (indexing, end_caps) = (Indexing::List, EndCaps::Chained);
            GeometryData::LinearSweptSpheres { positions, radii, indices: None, indexing, end_caps }
        }),
    ]
}

fn matrix() -> impl Strategy<Value = [[f32; 4]; 3]> {
    let entry = (-3i32..=3).prop_map(|k| k as f32);
    prop_oneof![
        Just(IDENTITY),
        prop::array::uniform3(prop::array::uniform4(entry)).prop_filter("has an inverse", |m| {
            let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
            m[0][0] * minor(1, 2) + m[0][1] * minor(2, 0) + m[0][2] * minor(0, 1) != 0.0
        })
    ]
}

/// One to nine instances of one or two BLASes, all opaque.
fn structure() -> impl Strategy<Value = Arc<Tlas>> {
    structure_of(Just(GeometryFlags::OPAQUE), Just(InstanceFlags::default()))
}

/// One to nine instances of one or two BLASes of two geometries each.
fn structure_of(
    geometry_flags: impl Strategy<Value = GeometryFlags> + Clone,
    instance_flags: impl Strategy<Value = InstanceFlags>,
) -> impl Strategy<Value = Arc<Tlas>> {
    let blas = prop::collection::vec((data(), [geometry_flags.clone(), geometry_flags]), 1..3);
    let places = prop::collection::vec((matrix(), any::<bool>(), instance_flags), 1..9);
    (blas, places).prop_map(|(data, places)| {
        let blas: Vec<_> = data
            .into_iter()
            .map(|(data, flags)| {
                let geometries = flags.map(|flags| Geometry::new(data.clone(), flags));
                Blas::new(geometries.to_vec()).expect("valid numbers")
            })
            .collect();
        let instances = places.into_iter().map(|(matrix, last, flags)| {
            let number = if last { blas.len() - 1 } else { 0 };
            TlasInstance { flags, ..TlasInstance::of(blas[number].clone(), matrix) }
        });
        Tlas::new(instances.collect()).expect("valid instances")
    })
}

/// A bundle of rays from one point, or rays from anywhere to anywhere.
fn rays() -> impl Strategy<Value = Vec<Ray>> {
    let spread = prop_oneof![Just(0.0f32), Just(0.01), Just(0.1), Just(1.0)];
    let steps = prop::collection::vec(prop::array::uniform3(-4i32..=4), 1..130);
    let t_max = prop_oneof![4 => Just(f32::INFINITY), 1 => Just(1.0f32)];
    prop_oneof![
        (point(), point(), spread, steps, t_max.clone()).prop_map(|(origin, way, spread, steps, t_max)| {
            steps
                .into_iter()
                .map(|step| {
                    let direction = std::array::from_fn(|k| way[k] + spread * step[k] as f32 * 0.25);
                    Ray::new(origin.map(|x| x * 4.0), direction).with_interval(0.0, t_max)
                })
                .collect::<Vec<_>>()
        }),
        prop::collection::vec((point(), point()), 1..130)
            .prop_map(move |all| { all.into_iter().map(|(origin, way)| Ray::new(origin, way)).collect() }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]
    #[test]
    fn each_finds_what_it_finds_alone(
        tlas in structure(),
        rays in rays(),
        flags in prop_oneof![3 => Just(0), 1 => Just(16), 1 => Just(32), 1 => Just(64), 1 => Just(256)],
    ) {
        let trace = |ray: &Ray| TraceRay { ray: *ray, flags: RayFlags(flags), cull_mask: 0xFF, time: 0.0 };
        check(&tlas, &rays.iter().map(trace).collect::<Vec<_>>());
    }
}

/// The hit that the traversal finds which reports its steps: it takes no short way.
fn traced_observed(tlas: &Tlas, trace: &TraceRay) -> Option<Committed> {
    let mut cursor = Cursor::new(tlas, *trace);
    assert!(cursor.proceed_observed(tlas, &mut Counters::default()).is_none(), "no shader decides");
    cursor.committed().copied()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]
    #[test]
    fn a_ray_alone_and_rays_that_take_turns_find_what_an_observed_one_finds(
        data in prop::collection::vec(data(), 1..3),
        instance_flags in prop::sample::select(vec![0, 0, 1, 2, 3]).prop_map(InstanceFlags),
        rays in rays(),
        flags in prop::collection::vec(prop::sample::select(vec![0, 0, 0, 16, 32, 64, 256]), 64),
        cull_mask in prop::sample::select(vec![0xFF, 0xFF, 0xFF, 0x01, 0xFE]),
    ) {
        let kind = data[0].kind();
        let geometries = data.into_iter().filter(|data| data.kind() == kind);
        let blas = Blas::new(geometries.map(|data| Geometry::new(data, GeometryFlags::OPAQUE)).collect());
        let instance = TlasInstance::of(blas.expect("valid numbers"), IDENTITY);
        let tlas = Tlas::new(vec![TlasInstance { flags: instance_flags, mask: 0x01, ..instance }]);
        let tlas = tlas.expect("a valid instance");
        let trace = |(ray, flags): (&Ray, &u32)| {
            TraceRay { ray: *ray, flags: RayFlags(*flags), cull_mask, time: 0.0 }
        };
        let traces: Vec<_> = rays.iter().zip(&flags).map(trace).collect();
        let wanted: Vec<_> = traces.iter().map(|trace| traced_observed(&tlas, trace)).collect();
        let mut cursor = Cursor::empty();
        for (trace, wanted) in traces.iter().zip(&wanted) {
            prop_assert_eq!(cursor.trace_opaque(&tlas, trace, false), wanted.as_ref());
            prop_assert_eq!(cursor.trace_opaque(&tlas, trace, true).is_some(), wanted.is_some());
        }
        let rays = u64::MAX >> (MAX_RAYS - traces.len());
        for (any_opaque_hit, baseline) in [(false, false), (false, true), (true, false)] {
            let mut packet = Packet::default();
            let turns = Turns { packet: &mut packet, tlas: &tlas, traces: &traces, rays, any_opaque_hit };
            let left = if baseline { BaselineSimd.dispatch(turns) } else { tlas.cpu_tier().run(turns) };
            for (at, wanted) in wanted.iter().enumerate().filter(|(at, _)| left >> at & 1 == 0) {
                let found = packet.committed(&tlas, at);
                if any_opaque_hit {
                    prop_assert_eq!(found.is_some(), wanted.is_some());
                } else {
                    prop_assert_eq!(found, *wanted, "ray {}", at);
                }
            }
        }
    }
}

#[test]
fn rays_take_turns_in_a_large_tree_of_one_instance() {
    let sphere = |k: u32| [(k % 200) as f32, (k / 200 % 200) as f32, (k / 40_000) as f32];
    let positions: Vec<_> = (0..120_000).map(sphere).collect();
    let radii = vec![0.25; positions.len()];
    let geometry = GeometryData::Spheres { positions, radii, indices: None };
    let blas = Blas::new(vec![Geometry::new(geometry, GeometryFlags::OPAQUE)]).expect("valid numbers");
    let tlas = Tlas::new(vec![TlasInstance::of(blas.clone(), IDENTITY)]).expect("a valid instance");
    assert!(!turns::pays(&tlas), "nothing is built");
    // Rays down the columns of three spheres, from above and from below by turns.
    let columns = (0..64u32).map(|k| [(k * 37 % 200) as f32, (k * 53 % 200) as f32]);
    let rays = columns.enumerate().map(|(k, [x, y])| {
        if k % 2 == 0 {
            Ray::new([x, y, 9.0], [0.0, 0.0, -1.0])
        } else {
            Ray::new([x, y, -9.0], [0.0, 0.0, 1.0])
        }
    });
    let trace = |ray| TraceRay { ray, flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 };
    let traces: Vec<_> = rays.map(trace).collect();
    let mut hits = Vec::new();
    for built in [false, true] {
        assert!(Packet::default().trace(&tlas, &traces, false, &mut hits));
        // The spheres end at z = 2.25 and begin at z = -0.25.
        let wanted = (0..64).map(|k| Some(if k % 2 == 0 { 6.75 } else { 8.75 }));
        assert!(hits.iter().map(|hit| hit.map(|hit| hit.t)).eq(wanted), "{built}");
        blas.built();
        assert!(turns::pays(&tlas));
    }
    // Where leaves are not tested as wholes no ray takes turns, and none is lost.
    for precision in Precision::ALL {
        let tlas = tlas.at_precision(precision);
        assert!(Packet::default().trace(&tlas, &traces, false, &mut hits));
        assert!(hits.iter().all(Option::is_some), "{precision:?}");
    }
}

/// Whether a shader that is made up accepts a candidate.
fn is_accepted(candidate: &Candidate) -> bool {
    (candidate.primitive * 5 + candidate.geometry * 3 + candidate.instance).is_multiple_of(4)
}

/// The candidates that a ray comes to, and what is committed in the end.
type Outcome = (Vec<Candidate>, Option<Committed>);

/// The candidates that each ray comes to until one is accepted, and what is committed then. With
/// `look_ahead` the rays find their next hits together. Also says how many were found so.
fn decided(
    tlas: &Arc<Tlas>,
    traces: &[TraceRay],
    mut look_ahead: Option<&mut LookAhead>,
) -> (Vec<Outcome>, usize) {
    let mut cursors: Vec<_> = traces.iter().map(|trace| Cursor::new(tlas, *trace)).collect();
    let mut candidates = vec![Vec::new(); traces.len()];
    let (mut running, mut found): (Vec<_>, _) = ((0..traces.len()).collect(), 0);
    while !running.is_empty() {
        if let Some(look_ahead) = &mut look_ahead
            && look_ahead.begin(tlas, running.len())
        {
            running.iter().for_each(|&at| look_ahead.add(at as u32, &cursors[at], tlas));
            look_ahead.find(|at, hit| {
                cursors[at as usize].take_next_hit(hit);
                found += 1;
            });
        }
        running.retain(|&at| {
            let Some(candidate) = cursors[at].proceed(tlas) else { return false };
            candidates[at].push(candidate);
            if is_accepted(&candidate) {
                assert!(cursors[at].confirm());
            }
            true
        });
    }
    let committed = cursors.iter().map(|cursor| cursor.committed().copied());
    (candidates.into_iter().zip(committed).collect(), found)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]
    #[test]
    fn each_comes_to_the_candidates_that_it_comes_to_alone(
        tlas in structure_of(
            prop_oneof![Just(GeometryFlags::default()), Just(GeometryFlags::OPAQUE)],
            prop_oneof![6 => Just(0), 1 => Just(2), 1 => Just(4), 1 => Just(8)].prop_map(InstanceFlags),
        ),
        rays in rays(),
        flags in prop::sample::select(vec![0, 0, 0, 2, 4, 16, 32, 64, 128, 256]),
    ) {
        let trace = |ray: &Ray| TraceRay { ray: *ray, flags: RayFlags(flags), cull_mask: 0xFF, time: 0.0 };
        let traces: Vec<_> = rays.iter().map(trace).collect();
        let (alone, _) = decided(&tlas, &traces, None);
        let (together, _) = decided(&tlas, &traces, Some(&mut LookAhead::default()));
        prop_assert_eq!(together, alone);
    }
}

#[test]
fn coherent_rays_find_their_candidates_together() {
    // Three layers of two triangles each, of which the second layer is opaque. The first triangle
    // of the first layer is accepted, the second is not.
    let (_, trace) = floor();
    let corner = |x: f32, y: f32, z: f32| [x * 9.0, y, z * 9.0];
    let layer = |y: f32| {
        let [a, b, c, d] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| corner(x, y, z));
        let vertices = vec![a, b, c, a, c, d];
        let flags = if y == -1.0 { GeometryFlags::OPAQUE } else { GeometryFlags::default() };
        Geometry::new(GeometryData::Triangles { vertices, indices: None, transform: None }, flags)
    };
    let blas = Blas::new((0..3).map(|k| layer(-(k as f32))).collect()).expect("valid numbers");
    let tlas = Tlas::new(vec![TlasInstance::of(blas, IDENTITY)]).expect("a valid instance");
    let traces: Vec<_> =
        (0..64).map(|k| trace((k % 8) as f32 * 0.1 - 0.3, (k / 8) as f32 * 0.1 - 0.45)).collect();
    let (alone, none) = decided(&tlas, &traces, None);
    let (together, found) = decided(&tlas, &traces, Some(&mut LookAhead::default()));
    assert_eq!(together, alone);
    assert_eq!(none, 0);
    // The first hits of all, and the next ones of those that ignored the first.
    assert!(found > 64, "{found}");
    // Boxes, micromaps and flags that cull by opacity are left to each ray.
    let culled: Vec<_> =
        traces.iter().map(|trace| TraceRay { flags: RayFlags::CULL_OPAQUE, ..*trace }).collect();
    assert_eq!(decided(&tlas, &culled, Some(&mut LookAhead::default())), decided(&tlas, &culled, None));
}

/// 64 x 64 triangles in one plane, and a camera above.
fn floor() -> (Arc<Tlas>, impl Fn(f32, f32) -> TraceRay) {
    let at = |i: usize, j: usize| [i as f32 * 0.125 - 4.0, 0.0, j as f32 * 0.125 - 4.0];
    let vertices = (0..4096).flat_map(|k| {
        let (i, j) = (k % 64, k / 64);
        [at(i, j), at(i + 1, j), at(i, j + 1)]
    });
    let data = GeometryData::Triangles { vertices: vertices.collect(), indices: None, transform: None };
    let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)]).expect("valid numbers");
    let tlas = Tlas::new(vec![TlasInstance::of(blas, IDENTITY)]).expect("a valid instance");
    let trace = |x: f32, z: f32| {
        let ray = Ray::new([0.1, 8.0, 0.1], [x, -8.0, z]);
        TraceRay { ray, flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 }
    };
    (tlas, trace)
}

#[test]
fn what_takes_long_together_is_given_up() {
    let (tlas, trace) = floor();
    let mut packet = Packet::default();
    let tile: Vec<_> =
        (0..64).map(|k| trace((k % 8) as f32 * 0.01 + 0.1, (k / 8) as f32 * 0.01 + 0.1)).collect();
    let mut hits = Vec::new();
    packet.trace(&tlas, &tile, false, &mut hits);
    assert!(hits.iter().any(Option::is_some) && packet.steps > 0, "{} steps are left", packet.steps);
    // Rays of one octant that are spread all over the floor soon leave the packet.
    let apart: Vec<_> =
        (0..64).map(|k| trace((k * 37 % 64) as f32 * 0.06, (k * 29 % 64) as f32 * 0.06)).collect();
    check(&tlas, &apart);

    // A thousand layers that all rays go through, as none of them shows the side that counts.
    let corners = |y: f32| [[-9.0, y, -9.0], [9.0, y, -9.0], [0.0, y, 9.0]];
    let vertices = (0..1000).flat_map(|k| corners(k as f32 * -0.001)).collect();
    let data = GeometryData::Triangles { vertices, indices: None, transform: None };
    let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)]).expect("valid numbers");
    let layers = Tlas::new(vec![TlasInstance::of(blas, IDENTITY)]).expect("a valid instance");
    let culled = |flags| tile.iter().map(|trace| TraceRay { flags, ..*trace }).collect::<Vec<_>>();
    let through = [RayFlags::CULL_BACK_FACING_TRIANGLES, RayFlags::CULL_FRONT_FACING_TRIANGLES]
        .map(culled)
        .into_iter()
        .find(|traces| traced_singly(&layers, &traces[0]).is_none())
        .expect("one of both sides");
    packet.trace(&layers, &through, false, &mut hits);
    assert!(hits.iter().all(Option::is_none));
    // The next two packets are not tried.
    assert_eq!((packet.steps, packet.failed_packets, packet.packet_cooldown), (0, 1, 2));
    packet.trace(&tlas, &tile, false, &mut hits);
    assert_eq!((packet.failed_packets, packet.packet_cooldown), (1, 1));
    assert!(hits.iter().any(Option::is_some));
}

#[test]
fn rays_of_other_flags_and_numbers_go_by_themselves() {
    let (tlas, trace) = floor();
    let mut traces: Vec<_> = (0..64).map(|k| trace(k as f32 * 0.01, 0.3)).collect();
    traces[3].ray.origin[0] = f32::NAN;
    traces[5].ray.direction = [0.0, -1e-30, 0.0];
    traces[7].ray.origin = [0.0, 1e6, 0.0];
    traces[9].ray.t_max = 1.0;
    traces[11].ray.t_min = f32::INFINITY;
    traces[13].ray.direction = [0.0, -1.0, -0.0];
    traces[19].ray.t_min = -1.0;
    check(&tlas, &traces);
    traces[15].flags = RayFlags::CULL_OPAQUE;
    check(&tlas, &traces);
    traces[17].flags = RayFlags::NO_OPAQUE;
    assert!(!Packet::default().trace(&tlas, &traces, false, &mut Vec::new()));
}
