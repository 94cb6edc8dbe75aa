//! Ray flags, pipeline flags, masks, intervals, any-hit and intersection control.

use anyhit_base::error::ErrorKind;
use anyhit_engine::accel::InstanceFlags;
use anyhit_engine::pipeline::PipelineFlags;
use anyhit_unit_test::scene::Instance;

use crate::rays::conformance::rig::{
    AnyHit, BOX, Kind, MISS, Plan, Probe, Rig, SPHERE, SWEPT, Shot, TRIANGLE, facing,
};

const OPAQUE: u32 = 1;
const NO_OPAQUE: u32 = 2;
const TERMINATE: u32 = 4;
const SKIP_CLOSEST_HIT: u32 = 8;
const CULL_BACK: u32 = 16;
const CULL_FRONT: u32 = 32;
const CULL_OPAQUE: u32 = 64;
const CULL_NO_OPAQUE: u32 = 128;
const SKIP_TRIANGLES: u32 = 256;
const SKIP_AABBS: u32 = 512;

/// What a ray may ask for (VUID-RuntimeSpirv-OpTraceRayKHR-06552, 06892, 06893).
fn is_legal(flags: u32) -> bool {
    let at_most_one = |bits: u32| (flags & bits).count_ones() <= 1;
    at_most_one(OPAQUE | NO_OPAQUE | CULL_OPAQUE | CULL_NO_OPAQUE)
        && at_most_one(SKIP_TRIANGLES | CULL_BACK | CULL_FRONT)
        && at_most_one(SKIP_TRIANGLES | SKIP_AABBS)
}

/// One primitive and how it is placed.
#[derive(Clone, Copy, Debug)]
struct Target {
    kind: Kind,
    stage: u32,
    front: bool,
    opaque: bool,
    instance: u32,
}

impl Target {
    fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for (kind, stage) in
            [(Kind::Triangle, TRIANGLE), (Kind::Box, BOX), (Kind::Swept, SPHERE), (Kind::Swept, SWEPT)]
        {
            for front in if stage == TRIANGLE { &[true, false][..] } else { &[true] } {
                for opaque in [true, false] {
                    // None, cull-disable, flip, force-opaque, force-no-opaque, flip with
                    // force-opaque.
                    for instance in [0, 1, 2, 4, 8, 6] {
                        all.push(Self { kind, stage, front: *front, opaque, instance });
                    }
                }
            }
        }
        all
    }

    fn instance(&self) -> Instance {
        let one = match self.stage {
            TRIANGLE => Instance::triangles(facing([0.0; 3], 1.0, self.front)),
            BOX => Instance::aabbs([[[-1.0, -1.0, -0.5], [1.0, 1.0, 0.5]]]),
            SPHERE => Instance::sphere([0.0; 3], 1.0),
            _ => Instance::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1.0, 1.0]),
        };
        let one = one.flags(InstanceFlags(self.instance));
        if self.opaque { one.opaque() } else { one }
    }

    /// Vulkan, "Ray Traversal": what runs for a ray with these flags.
    fn expected(&self, flags: u32, pipeline: u32) -> (u32, u32) {
        let has = |bit: u32| flags & bit != 0;
        let skips = if self.stage == BOX { SKIP_AABBS } else { SKIP_TRIANGLES };
        let skipped = (flags | pipeline) & skips != 0;
        let opaque = if has(OPAQUE) || has(NO_OPAQUE) {
            has(OPAQUE)
        } else if self.instance & 12 != 0 {
            self.instance & 4 != 0
        } else {
            self.opaque
        };
        let culled_by_opacity = if opaque { has(CULL_OPAQUE) } else { has(CULL_NO_OPAQUE) };
        let front = self.front != (self.instance & 2 != 0);
        let faces_count = self.stage == TRIANGLE && self.instance & 1 == 0;
        let culled_by_face = faces_count && if front { has(CULL_FRONT) } else { has(CULL_BACK) };
        if skipped || culled_by_opacity || culled_by_face {
            return (MISS, 0);
        }
        (if has(SKIP_CLOSEST_HIT) { 0 } else { self.stage }, u32::from(!opaque))
    }
}

/// All legal combinations of ray flags, on front and back, opaque and not, four kinds of
/// primitives, six sets of instance flags: which shaders run, and what they are told the flags are.
#[test]
fn ray_flags() {
    let legal: Vec<u32> = (0..1024).filter(|&flags| is_legal(flags)).collect();
    // 2^2 of terminate and skip-closest-hit, 5 of opacity, and of the rest none, one of three, or
    // boxes with none or one of two faces: 4 * 5 * (4 + 3).
    assert_eq!(legal.len(), 140);
    for target in Target::all() {
        let plan = Plan { reports: 1, t: [2.0, 0.0], ..Plan::default() };
        let shots: Vec<Shot> =
            legal.iter().map(|&flags| Shot { flags, ..Shot::down([0.0, 0.0, 2.0]) }).collect();
        let probes = Rig::with([(target.kind, plan)]).run([target.instance()], &shots);
        for (&flags, probe) in legal.iter().zip(&probes) {
            let expected = target.expected(flags, 0);
            assert_eq!((probe.stage, probe.any_hits), expected, "{target:?}, flags {flags:#x}");
            if probe.stage != 0 {
                assert_eq!(probe.flags, flags);
            }
            if probe.any_hits > 0 {
                assert_eq!(probe.seen_flags, flags);
            }
        }
    }
}

/// A pipeline's own skips act like the ray's, and no shader sees them.
#[test]
fn pipeline_flags() {
    for (pipeline, bit) in [
        (PipelineFlags { skip_triangles: true, ..PipelineFlags::default() }, SKIP_TRIANGLES),
        (PipelineFlags { skip_aabbs: true, ..PipelineFlags::default() }, SKIP_AABBS),
    ] {
        for target in Target::all().into_iter().filter(|target| target.instance == 0) {
            let plan = Plan { reports: 1, t: [2.0, 0.0], ..Plan::default() };
            let shot = Shot::down([0.0, 0.0, 2.0]);
            let rig = Rig::with([(target.kind, plan)]).flags(pipeline);
            let probe = rig.run([target.instance()], &[shot])[0];
            assert_eq!((probe.stage, probe.any_hits), target.expected(0, bit), "{target:?}");
            assert_eq!(probe.flags, 0);
        }
    }
}

/// A ray may not skip what the pipeline leaves (VUID-RuntimeSpirv-OpTraceRayKHR-06553 and 06554).
#[test]
fn a_ray_and_its_pipeline_cannot_skip_everything() {
    for (pipeline, flags) in [
        (PipelineFlags { skip_triangles: true, ..PipelineFlags::default() }, SKIP_AABBS),
        (PipelineFlags { skip_aabbs: true, ..PipelineFlags::default() }, SKIP_TRIANGLES),
    ] {
        let scene = || [Instance::triangles(facing([0.0; 3], 1.0, true))];
        let launch = |flags| {
            let shot = Shot { flags, ..Shot::down([0.0, 0.0, 1.0]) };
            Rig::of(Kind::Triangle).flags(pipeline).launch(scene(), &[shot], [1, 1, 1])
        };
        assert_eq!(launch(flags).expect_err("a trap").kind(), ErrorKind::Trap);
        // What the pipeline skips anyway a ray may skip, too.
        assert!(launch(flags ^ (SKIP_TRIANGLES | SKIP_AABBS)).is_ok());
    }
}

/// 255 instances with masks 1 to 255, each alone on its ray: seen where mask and cull mask share a
/// bit; only eight bits of the cull mask count, and shaders are told those.
#[test]
fn cull_masks() {
    let scene = (1..=255u32)
        .map(|mask| Instance::triangles(facing([mask as f32, 0.0, 0.0], 0.4, true)).mask(mask as u8));
    let mut shots = Vec::new();
    let mut wanted = Vec::new();
    for mask in 1..=255u32 {
        for cull_mask in [mask, !mask & 0xFF, 1 << (mask % 8), mask | 0xABCD_EF00, !mask] {
            shots.push(Shot { cull_mask, ..Shot::down([mask as f32, 0.0, 1.0]) });
            wanted.push(if mask & cull_mask & 0xFF != 0 { TRIANGLE } else { MISS });
        }
    }
    let probes = Rig::of(Kind::Triangle).run(scene, &shots);
    let stages: Vec<u32> = probes.iter().map(|probe| probe.stage).collect();
    assert_eq!(stages, wanted);
}

/// Code behind the end of an any-hit shader never runs; what it wrote before counts; a miss shader
/// runs where all was ignored.
#[test]
fn any_hit_shaders_end_where_they_say() {
    // Two layers: primitive 0 at z = 0, primitive 1 behind.
    let layers =
        || Instance::triangles([facing([0.0; 3], 1.0, true), facing([0.0, 0.0, -1.0], 1.0, true)].concat());
    let run = |any_hit, flags| {
        let plan = Plan { any_hit, ..Plan::default() };
        let shot = Shot { flags, ..Shot::down([0.0, 0.0, 1.0]) };
        Rig::with([(Kind::Triangle, plan)]).run([layers()], &[shot])[0]
    };
    let found = |probe: Probe| (probe.stage, probe.any_hits, probe.primitive, probe.t_max, probe.never);
    // The nearer is presented first, and accepting it leaves nothing behind it.
    assert_eq!(found(run(AnyHit::ACCEPT, 0)), (TRIANGLE, 1, 0, 1.0, 0));
    assert_eq!(found(run(AnyHit::IGNORE, 0)), (MISS, 2, 0, 9.0, 0));
    assert_eq!(found(run(AnyHit::IGNORE_EVEN, 0)), (TRIANGLE, 2, 1, 2.0, 0));
    assert_eq!(found(run(AnyHit::TERMINATE, 0)), (TRIANGLE, 1, 0, 1.0, 0));
    assert_eq!(found(run(AnyHit::TERMINATE_IN_A_FUNCTION, 0)), (TRIANGLE, 1, 0, 1.0, 0));
    // An ignored hit does not end a ray that ends at its first.
    assert_eq!(found(run(AnyHit::IGNORE_EVEN, TERMINATE)), (TRIANGLE, 2, 1, 2.0, 0));
    // Skipping the closest-hit shader skips nothing else.
    assert_eq!(found(run(AnyHit::TERMINATE, SKIP_CLOSEST_HIT)), (0, 1, 0, 0.0, 0));
    assert_eq!(found(run(AnyHit::IGNORE, SKIP_CLOSEST_HIT)), (MISS, 2, 0, 9.0, 0));
}

/// A box whose shader reports nothing, one hit, hits that any-hit ignores or that end the ray.
#[test]
fn reports_and_their_results() {
    let boxes = || Instance::aabbs([[[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]]);
    let run = |any_hit, reports, t| {
        let plan = Plan { any_hit, reports, t, kind: [1, 2], ..Plan::default() };
        Rig::with([(Kind::Box, plan)]).run([boxes()], &[Shot::down([0.0, 0.0, 2.0])])[0]
    };
    let found = |probe: Probe| (probe.stage, probe.any_hits, probe.hit_kind, probe.t_max);
    assert_eq!(found(run(AnyHit::ACCEPT, 0, [0.0; 2])), (MISS, 0, 0, 9.0));
    assert_eq!(found(run(AnyHit::ACCEPT, 1, [1.5, 0.0])), (BOX, 1, 1, 1.5));
    assert_eq!(found(run(AnyHit::IGNORE, 2, [1.5, 1.25])), (MISS, 2, 0, 9.0));
    // The first report is ignored and answered with false, the second accepted.
    let second = run(AnyHit::IGNORE_BEYOND_A_HALF, 2, [0.7, 0.2]);
    assert_eq!(found(second), (BOX, 2, 2, 0.2));
    assert_eq!(second.attribute, [2.0, 9.0, 9.0, 0.0]);
    // An any-hit shader that ends the ray: the report does not return, so there is no second.
    assert_eq!(found(run(AnyHit::TERMINATE, 2, [1.5, 1.25])), (BOX, 1, 1, 1.5));
    assert_eq!(found(run(AnyHit::TERMINATE_IN_A_FUNCTION, 2, [1.5, 1.25])), (BOX, 1, 1, 1.5));
    // All 32 bytes of attributes come through.
    let whole = run(AnyHit::ACCEPT, 1, [1.5, 0.0]);
    assert_eq!(whole.vertices[0], [5.0, 6.0, 7.0]);
    assert_eq!(whole.vertices[1][0], 8.0);
}

/// Triangles lie strictly within the interval, everything else at its ends, too.
#[test]
fn intervals() {
    let run = |kind, scene: Instance, t_min, t_max, report| {
        let plan = Plan { reports: 1, t: [report, 0.0], ..Plan::default() };
        let shot = Shot { t_min, t_max, ..Shot::down([0.0, 0.0, 2.0]) };
        Rig::with([(kind, plan)]).run([scene], &[shot])[0].stage
    };
    let (below, above) = (2f32.next_down(), 2f32.next_up());
    // t = 2 for the triangle at z = 0, t = 1 for the sphere of radius 1, t = 2 for the report.
    let triangle = |t_min, t_max| {
        run(Kind::Triangle, Instance::triangles(facing([0.0; 3], 1.0, true)), t_min, t_max, 0.0)
    };
    assert_eq!([triangle(2.0, 9.0), triangle(0.0, 2.0)], [MISS; 2]);
    assert_eq!([triangle(below, 9.0), triangle(0.0, above)], [TRIANGLE; 2]);
    let sphere = |t_min, t_max| run(Kind::Swept, Instance::sphere([0.0; 3], 1.0), t_min, t_max, 0.0);
    assert_eq!([sphere(1.0, 9.0), sphere(0.0, 1.0), sphere(1.0, 1.0)], [SPHERE; 3]);
    assert_eq!([sphere(1f32.next_up(), 9.0), sphere(0.0, 1f32.next_down())], [MISS; 2]);
    let capsule = Instance::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1.0; 2]);
    let swept = |t_min, t_max| run(Kind::Swept, capsule.clone(), t_min, t_max, 0.0);
    assert_eq!([swept(1.0, 9.0), swept(0.0, 1.0)], [SWEPT; 2]);
    assert_eq!([swept(1f32.next_up(), 9.0), swept(0.0, 1f32.next_down())], [MISS; 2]);
    let boxed = Instance::aabbs([[[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]]);
    let boxed = |t_min, t_max| run(Kind::Box, boxed.clone(), t_min, t_max, 2.0);
    assert_eq!([boxed(2.0, 9.0), boxed(0.0, 2.0)], [BOX; 2]);
    assert_eq!([boxed(above, 9.0), boxed(0.0, below)], [MISS; 2]);
}

/// A ray that starts inside a box calls its intersection shader, wherever it ends.
#[test]
fn rays_from_inside_a_box() {
    let boxed = Instance::aabbs([[[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]]);
    for origin in [[0.0, 0.0, 0.0], [0.9, -0.9, 0.5], [1.0, 1.0, 1.0], [-1.0, 0.0, 0.0]] {
        for direction in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.5, -0.25, 2.0]] {
            for t_min in [0.0, 0.25] {
                // Inside, at the edge, outside; and t_max = t_min.
                for t_max in [t_min, 0.5, 1.0, 100.0] {
                    let plan = Plan { reports: 1, t: [t_min, 0.0], ..Plan::default() };
                    let starts_inside =
                        (0..3).all(|axis| f32::abs(origin[axis] + t_min * direction[axis]) <= 1.0);
                    let shot = Shot { origin, direction, t_min, t_max, ..Shot::down(origin) };
                    let probe = Rig::with([(Kind::Box, plan)]).run([boxed.clone()], &[shot])[0];
                    if starts_inside {
                        assert_eq!((probe.stage, probe.t_max), (BOX, t_min), "{shot:?}");
                    }
                }
            }
        }
    }
}

/// Every operand differs from ray to ray, and each alone causes its miss.
#[test]
fn operands_that_differ_from_ray_to_ray() {
    let good = Shot { t_min: 0.5, t_max: 2.0, ..Shot::down([0.0, 0.0, 1.0]) };
    let causes = [
        (good, TRIANGLE),
        (Shot { flags: CULL_FRONT, ..good }, MISS),
        (Shot { flags: SKIP_TRIANGLES, ..good }, MISS),
        (Shot { flags: CULL_NO_OPAQUE, ..good }, MISS),
        (Shot { cull_mask: 0xF0, ..good }, MISS),
        (Shot { t_min: 1.0, ..good }, MISS),
        (Shot { t_max: 1.0, ..good }, MISS),
        (Shot { origin: [3.0, 0.0, 1.0], ..good }, MISS),
        (Shot { direction: [0.0, 0.0, 1.0], ..good }, MISS),
    ];
    let shots: Vec<Shot> = (0..144)
        .map(|at| Shot { miss_index: at as u32 / 9, sbt_offset: at as u32 / 9, ..causes[at % 9].0 })
        .collect();
    let records = (0..16).map(|id| (Kind::Triangle, Plan { id, ..Plan::default() }));
    let scene = Instance::triangles(facing([0.0; 3], 1.0, true)).mask(0x0F);
    let probes = Rig::with(records).misses(16).run([scene], &shots);
    for (at, probe) in probes.iter().enumerate() {
        let (stage, record) = (causes[at % 9].1, at as u32 / 9);
        let wanted = if stage == MISS { 100 + record } else { record };
        assert_eq!((probe.stage, probe.record), (stage, wanted), "ray {at}");
    }
}

/// A picture does not depend on whether a surface is in one box or cut into many boxes.
#[test]
fn how_many_boxes_hold_a_surface_does_not_show() {
    let plan = Plan { reports: 1, t: [1.5, 0.0], kind: [9, 0], ..Plan::default() };
    let shots: Vec<Shot> = (0..64)
        .map(|at| Shot::down([(at % 8) as f32 * 0.25 - 0.875, (at / 8) as f32 * 0.25 - 0.875, 2.0]))
        .collect();
    let picture = |boxes: Vec<[[f32; 3]; 2]>| {
        let probes = Rig::with([(Kind::Box, plan)]).run([Instance::aabbs(boxes)], &shots);
        probes.iter().map(|probe| (probe.stage, probe.hit_kind, probe.t_max)).collect::<Vec<_>>()
    };
    let one = picture(vec![[[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]]);
    let strip = |x: usize| [[x as f32 * 0.25 - 1.0, -1.0, -1.0], [x as f32 * 0.25 - 0.75, 1.0, 1.0]];
    assert_eq!(picture((0..8).map(strip).collect()), one);
    let overlapping = (0..20).map(|at| [[-1.0, -1.0, -1.0 + at as f32 / 40.0], [1.0, 1.0, 1.0]]);
    assert_eq!(picture(overlapping.collect()), one);
    assert!(one.iter().all(|&(stage, kind, t)| (stage, kind, t) == (BOX, 9, 1.5)));
}

/// Null instances, instances without primitives and inactive ones are never hit and count all the
/// same.
#[test]
fn null_and_inactive_instances_are_counted() {
    let inactive = Instance::triangles([[f32::NAN, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]);
    let empty = Instance::aabbs([]);
    let mixed = Instance::triangles(
        [[[f32::NAN, 0.0, 0.0], [0.0; 3], [0.0; 3]], facing([0.0; 3], 1.0, true)].concat(),
    );
    let probe = Rig::of(Kind::Triangle).run([inactive, empty, mixed], &[Shot::down([0.0, 0.0, 1.0])])[0];
    assert_eq!((probe.stage, probe.instance, probe.primitive), (TRIANGLE, 2, 1));
}
