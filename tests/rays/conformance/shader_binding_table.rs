//! Which record a ray uses, and null records.

use anyhit_unit_test::scene::Instance;

use crate::rays::conformance::rig::{AnyHit, Kind, MISS, Plan, Rig, Shot, TRIANGLE, facing};

fn numbered(count: u32) -> Rig {
    Rig::with((0..count).map(|id| (Kind::Triangle, Plan { id, ..Plan::default() })))
}

/// Record = SBT offset + the instance's offset + geometry index * SBT stride; offset and stride
/// have four bits.
#[test]
fn hit_records() {
    let mut shots = Vec::new();
    let mut wanted = Vec::new();
    let instance_offsets = [0, 1, 7, 64];
    for (at, instance_offset) in instance_offsets.into_iter().enumerate() {
        for geometry in 0..3 {
            for sbt_offset in 0..8 {
                for sbt_stride in [0, 1, 2, 15] {
                    // Bits beyond the fourth do not count.
                    let high = if (sbt_offset + geometry) % 2 == 0 { 0x10 } else { 0xABCD_EF00 };
                    shots.push(Shot {
                        sbt_offset: sbt_offset | high,
                        sbt_stride: sbt_stride | high,
                        ..Shot::down([at as f32, geometry as f32, 1.0])
                    });
                    wanted.push(sbt_offset + instance_offset + geometry * sbt_stride);
                }
            }
        }
    }
    let scene = instance_offsets.into_iter().enumerate().map(|(at, offset)| {
        let geometry = |y: u32| Instance::triangles(facing([at as f32, y as f32, 0.0], 0.4, true));
        geometry(0).and(geometry(1)).and(geometry(2)).sbt_offset(offset)
    });
    let probes = numbered(128).run(scene, &shots);
    for (probe, wanted) in probes.iter().zip(&wanted) {
        // Any-hit and closest-hit shaders read the same record.
        assert_eq!((probe.stage, probe.record, probe.seen_record), (TRIANGLE, *wanted, *wanted));
    }
    assert_eq!(probes.len(), 4 * 3 * 8 * 4);
}

/// The miss index alone chooses the miss record; it has 16 bits.
#[test]
fn miss_records() {
    let shots: Vec<Shot> = (0..32)
        .map(|miss_index| Shot {
            miss_index: miss_index | if miss_index % 2 == 0 { 0 } else { 0x5_0000 },
            sbt_offset: 3,
            sbt_stride: 5,
            ..Shot::down([9.0, 0.0, 1.0])
        })
        .collect();
    let probes = numbered(1).misses(32).run([Instance::triangles(facing([0.0; 3], 1.0, true))], &shots);
    for (index, probe) in probes.iter().enumerate() {
        assert_eq!((probe.stage, probe.record), (MISS, 100 + index as u32));
    }
}

/// A null record or a missing member of a group: nothing runs, what is hit stays hit.
#[test]
fn null_shaders() {
    let triangle = || Instance::triangles(facing([0.0; 3], 1.0, true));
    let boxes = || Instance::aabbs([[[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]]);
    let one = |kind, any_hit, scene| {
        let plan = Plan { id: 5, any_hit, reports: 1, t: [1.5, 0.0], ..Plan::default() };
        Rig::with([(kind, plan)]).run([scene], &[Shot::down([0.0, 0.0, 2.0])])[0]
    };
    // Without an any-hit shader the candidate is confirmed.
    let probe = one(Kind::NoAnyHit, AnyHit::IGNORE, triangle());
    assert_eq!((probe.stage, probe.any_hits), (TRIANGLE, 0));
    // Without a closest-hit shader neither that nor a miss shader runs.
    let probe = one(Kind::NoClosestHit, AnyHit::ACCEPT, triangle());
    assert_eq!((probe.stage, probe.any_hits), (0, 1));
    let probe = one(Kind::NoClosestHit, AnyHit::IGNORE, triangle());
    assert_eq!((probe.stage, probe.any_hits), (MISS, 1));
    let probe = one(Kind::Null, AnyHit::ACCEPT, triangle());
    assert_eq!((probe.stage, probe.any_hits), (0, 0));
    // Without an intersection shader a box has no hit.
    assert_eq!(one(Kind::NoIntersection, AnyHit::ACCEPT, boxes()).stage, MISS);
    assert_eq!(one(Kind::Null, AnyHit::ACCEPT, boxes()).stage, MISS);
}
