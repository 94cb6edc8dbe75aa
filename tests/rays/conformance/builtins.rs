//! Builtins of every stage: launch id and size, ids, hit kind, t, rays, matrices.

use anyhit_engine::accel::{GeometryData, InstanceFlags};
use anyhit_unit_test::scene::Instance;

use crate::rays::conformance::rig::{AnyHit, BOX, Kind, MISS, Plan, Rig, Shot, TRIANGLE, facing};

/// The launch id of a linear index, and the volume of the launch, in every stage that notes them.
#[test]
fn launch_id_and_size() {
    for size in [[16, 1, 1], [1, 16, 1], [1, 1, 16], [4, 4, 4], [7, 3, 2], [1, 13, 5]] {
        let volume: u32 = size.iter().product();
        // Every other ray hits.
        let shots: Vec<Shot> = (0..volume).map(|at| Shot::down([0.0, 5.0 * (at % 2) as f32, 1.0])).collect();
        let scene = [Instance::triangles(facing([0.0; 3], 1.0, true))];
        let probes = Rig::of(Kind::Triangle).launch(scene, &shots, size).expect("no trap");
        for (at, probe) in (0..volume).zip(probes) {
            let id = [at % size[0], at / size[0] % size[1], at / size[0] / size[1]];
            assert_eq!((probe.launch_id, probe.launch_volume), (id, volume), "{size:?}");
            assert_eq!(probe.stage, if at % 2 == 0 { TRIANGLE } else { MISS });
        }
    }
}

/// One primitive a cell of 8 x 4, in raster order n: 4 instances of 2 geometries of 4 primitives.
fn cells(boxes: bool) -> Vec<Instance> {
    let geometry = |first: usize| {
        let centres = (first..first + 4).map(|n| [(n % 8) as f32, (n / 8) as f32, 0.0]);
        if boxes {
            return Instance::aabbs(
                centres.map(|[x, y, z]| [[x - 0.4, y - 0.4, z - 0.1], [x + 0.4, y + 0.4, z]]),
            );
        }
        Instance::triangles(centres.flat_map(|centre| facing(centre, 0.4, true)).collect::<Vec<_>>())
    };
    let instance = |at: usize| geometry(8 * at).and(geometry(8 * at + 4)).custom_index(2 * at as u32);
    (0..4).map(instance).collect()
}

#[test]
fn primitive_geometry_instance_and_custom_index() {
    let shots: Vec<Shot> = (0..32).map(|n| Shot::down([(n % 8) as f32, (n / 8) as f32, 1.0])).collect();
    let report = Plan { reports: 1, t: [1.05, 0.0], kind: [0x7E, 0], ..Plan::default() };
    for (kind, stage) in [(Kind::Triangle, TRIANGLE), (Kind::Box, BOX)] {
        // Both geometries use one record: SBT stride 0.
        let shots: Vec<Shot> = shots.iter().map(|shot| Shot { sbt_stride: 0, ..*shot }).collect();
        let probes = Rig::with([(kind, report)]).run(cells(kind == Kind::Box), &shots);
        for (n, probe) in (0..32).zip(probes) {
            let found = [probe.stage, probe.primitive, probe.geometry, probe.instance, probe.custom_index];
            assert_eq!(found, [stage, n % 4, n / 4 % 2, n / 8, n / 8 * 2], "{n}");
        }
    }
}

/// A front, a back, a flipped one of each, and a box's own kind, in any-hit and closest-hit.
#[test]
fn hit_kinds() {
    let at = |x: f32, front| Instance::triangles(facing([x, 0.0, 0.0], 0.4, front));
    let flip = InstanceFlags::TRIANGLE_FLIP_FACING;
    let mirror = [[1.0, 0.0, 0.0, 4.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let scene = [
        at(0.0, true),
        at(1.0, false),
        at(2.0, true).flags(flip),
        at(3.0, false).flags(flip),
        // A mirroring instance changes nothing: facing is decided in object space.
        at(0.0, true).transform(mirror),
        at(5.0, true).opaque(),
        Instance::aabbs([[[5.6, -0.4, -0.4], [6.4, 0.4, 0.4]]]).sbt_offset(1),
    ];
    let report = Plan { reports: 1, t: [1.0, 0.0], kind: [0x7E, 0], ..Plan::default() };
    let rig = Rig::with([(Kind::Triangle, Plan::default()), (Kind::Box, report)]);
    let shots: Vec<Shot> = (0..7).map(|x| Shot::down([x as f32, 0.0, 1.0])).collect();
    let probes = rig.run(scene, &shots);
    let kinds: Vec<_> = probes.iter().map(|probe| (probe.hit_kind, probe.seen_kind)).collect();
    let (front, back) = ((254, 254), (255, 255));
    // No any-hit shader sees the opaque one.
    assert_eq!(kinds, [front, back, back, front, front, (254, 0), (0x7E, 0x7E)]);
}

/// t_min, t_max and the hit's t in the stages, for a grid of a = x / 4 and b = 1 + y / 4.
#[test]
fn t_in_every_stage() {
    for y in 0..4 {
        for x in 0..4 {
            let c = 0.25 * (x as f32 / 4.0) / (1.0 + y as f32 / 4.0);
            let (t_min, t_max, near) = (c, 0.75 + c, 0.03125 + c);
            let shot = Shot { t_min, t_max, ..Shot::down([0.0; 3]) };
            let triangle = |z: f32| Instance::triangles(facing([0.0, 0.0, z], 1.0, true));
            let hit = Rig::of(Kind::Triangle).run([triangle(-near)], &[shot])[0];
            // Origin z is 0 and the direction -1: t is -z exactly.
            assert_eq!((hit.stage, hit.t_min, hit.t_max, hit.seen_t), (TRIANGLE, t_min, near, near));
            // An ignored candidate leaves the miss shader the t_max that was passed.
            let ignores = Plan { any_hit: AnyHit::IGNORE, ..Plan::default() };
            let miss = Rig::with([(Kind::Triangle, ignores)]).run([triangle(-near)], &[shot])[0];
            assert_eq!((miss.stage, miss.t_min, miss.t_max, miss.any_hits), (MISS, t_min, t_max, 1));
            assert_eq!(miss.seen_t, near);
        }
    }
}

/// In an intersection shader t_max is the closest so far, and shrinks with an accepted report.
#[test]
fn t_max_in_an_intersection_shader() {
    let shot = Shot { t_max: 0.75, ..Shot::down([0.0; 3]) };
    let one = Instance::aabbs([[[-1.0, -1.0, -0.5], [1.0, 1.0, -0.1]]]);
    let reports = |t| Plan { reports: 2, t, kind: [1, 2], ..Plan::default() };
    let run = |plan, boxes: Instance| Rig::with([(Kind::Box, plan)]).run([boxes], &[shot])[0];
    // Attributes: number of the report, t_max before the first, t_max before this, first accepted.
    let closer = run(reports([0.4375, 0.25]), one.clone());
    assert_eq!(closer.attribute, [2.0, 0.75, 0.4375, 1.0]);
    assert_eq!((closer.t_max, closer.hit_kind, closer.any_hits), (0.25, 2, 2));
    // Farther than the accepted one: not accepted, no any-hit runs, the first stays.
    let farther = run(reports([0.25, 0.4375]), one.clone());
    assert_eq!(farther.attribute, [1.0, 0.75, 0.75, 0.0]);
    assert_eq!((farther.t_max, farther.hit_kind, farther.any_hits), (0.25, 1, 1));
    // Beyond the ray's own t_max, then within.
    let beyond = run(reports([0.875, 0.5]), one);
    assert_eq!(beyond.attribute, [2.0, 0.75, 0.75, 0.0]);
    // The second box's shader sees what the first one left.
    let two =
        Instance::aabbs([[[-1.0, -1.0, -0.5], [1.0, 1.0, -0.1]], [[-1.0, -1.0, -0.6], [1.0, 1.0, -0.2]]]);
    let both = run(Plan { reports: 1, t: [0.4375, 0.0], kind: [3, 0], ..Plan::default() }, two);
    // At equal t the first primitive keeps the hit.
    assert_eq!((both.primitive, both.t_max, both.attribute[1]), (0, 0.4375, 0.75));
}

/// Instance i moves x by 1/8 if i is odd and y by 1/16 if its second bit is set.
#[test]
fn rays_and_matrices_of_an_instance() {
    for (kind, stage) in [(Kind::Triangle, TRIANGLE), (Kind::Box, BOX)] {
        let plan = Plan { reports: 1, t: [1.5, 0.0], ..Plan::default() };
        for i in 0..4u32 {
            let moved = [if i & 1 != 0 { 0.125 } else { 0.0 }, if i & 2 != 0 { 0.0625 } else { 0.0 }, 0.0];
            let one = match kind {
                Kind::Box => Instance::aabbs([[[-1.0, -1.0, -0.5], [1.0, 1.0, 0.5]]]),
                _ => Instance::triangles(facing([0.0; 3], 1.0, true)),
            };
            let origin = [0.1875, -0.3125, 1.0];
            let probe = Rig::with([(kind, plan)]).run([one.translate(moved)], &[Shot::down(origin)])[0];
            assert_eq!(probe.stage, stage);
            assert_eq!((probe.world_origin, probe.world_direction), (origin, [0.0, 0.0, -1.0]));
            let object: [f32; 3] = std::array::from_fn(|axis| origin[axis] - moved[axis]);
            assert_eq!((probe.object_origin, probe.object_direction), (object, [0.0, 0.0, -1.0]));
            let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            assert_eq!((&probe.object_to_world[..3], probe.object_to_world[3]), (&axes[..], moved));
            assert_eq!(&probe.world_to_object[..3], &axes[..]);
            assert_eq!(probe.world_to_object[3], moved.map(|x| 0.0 - x));
        }
    }
}

/// The vertices of the triangle in object space, after the geometry's transform, whatever the
/// instance's.
#[test]
fn vertex_positions() {
    let vertices = facing([0.25, 0.0, 0.5], 0.75, true);
    let scaled = [[2.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let doubled = |transform| {
        let data = GeometryData::Triangles { vertices: vertices.to_vec(), indices: None, transform };
        Rig::of(Kind::Triangle).run([Instance::of(data).transform(scaled)], &[Shot::down([0.0, 0.0, 2.0])])[0]
    };
    let plain = doubled(None);
    assert_eq!((plain.stage, plain.vertices), (TRIANGLE, vertices));
    let both = doubled(Some(scaled));
    assert_eq!(both.vertices, vertices.map(|[x, y, z]| [2.0 * x, 2.0 * y, z]));
}
