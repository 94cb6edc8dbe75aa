//! The cursor's rules on scenes small enough to be worked out by hand: quads, boxes and spheres
//! stacked along +z, so that each one's t is its distance.

use std::sync::Arc;

use anyhit_base::error::ErrorKind;
use anyhit_engine::accel::{
    Blas, Candidate, Counters, Cursor, Geometry, GeometryData, GeometryFlags, HitKind, HitPrimitive,
    InstanceFlags, InstanceVerdict, Motion, Packet, Primitive, PrimitiveVerdict, RayFlags, Srt, Tlas,
    TlasInstance, TraceRay, TraversalObserver,
};
use anyhit_engine::geometry::Ray;

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
const OPAQUE: GeometryFlags = GeometryFlags::OPAQUE;
const NON_OPAQUE: GeometryFlags = GeometryFlags(0);

/// A triangle across the z axis at z. Seen from the origin it shows its back: drawn left-handed (x
/// to the right, y up, z away from the viewer) it is wound counter-clockwise, and Vulkan calls
/// clockwise front there.
fn triangle(z: f32) -> Vec<[f32; 3]> {
    vec![[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 2.0, z]]
}

fn triangles(at: &[f32], flags: GeometryFlags) -> Geometry {
    let vertices = at.iter().flat_map(|&z| triangle(z)).collect();
    Geometry::new(GeometryData::Triangles { vertices, indices: None, transform: None }, flags)
}

fn boxes(at: &[(f32, f32)], flags: GeometryFlags) -> Geometry {
    let corners = at.iter().map(|&(near, far)| [-1.0, -1.0, near, 1.0, 1.0, far]).collect();
    Geometry::new(GeometryData::Aabbs(corners), flags)
}

fn instance(geometries: Vec<Geometry>) -> TlasInstance {
    TlasInstance::of(Blas::new(geometries).unwrap(), IDENTITY)
}

fn tlas(instances: Vec<TlasInstance>) -> Arc<Tlas> {
    Tlas::new(instances).unwrap()
}

fn along_z(flags: u32) -> TraceRay {
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]).with_interval(0.0, 100.0);
    TraceRay { ray, flags: RayFlags(flags), cull_mask: 0xFF, time: 0.0 }
}

/// The t of each candidate when all are passed over, then the committed t.
fn ignore_all(tlas: &Tlas, trace: TraceRay) -> (Vec<f32>, Option<f32>) {
    let mut cursor = Cursor::new(tlas, trace);
    let seen = std::iter::from_fn(|| cursor.proceed(tlas)).map(|c| c.intersection.t).collect();
    (seen, cursor.committed().map(|hit| hit.t))
}

#[test]
fn candidates_ascend_and_stop_at_the_opaque_hit() {
    let scene = tlas(vec![
        instance(vec![triangles(&[5.0, 2.0, 9.0], NON_OPAQUE)]),
        instance(vec![triangles(&[6.0, 7.0], OPAQUE)]),
        instance(vec![triangles(&[3.0], NON_OPAQUE)]),
    ]);
    assert_eq!(ignore_all(&scene, along_z(0)), (vec![2.0, 3.0, 5.0], Some(6.0)));
    // The ray's word on opacity over the geometry's.
    assert_eq!(ignore_all(&scene, along_z(1)), (vec![], Some(2.0)));
    assert_eq!(ignore_all(&scene, along_z(2)), (vec![2.0, 3.0, 5.0, 6.0, 7.0, 9.0], None));
    assert_eq!(ignore_all(&scene, along_z(64)), (vec![2.0, 3.0, 5.0, 9.0], None));
    assert_eq!(ignore_all(&scene, along_z(128)), (vec![], Some(6.0)));
    assert_eq!(ignore_all(&scene, along_z(256)), (vec![], None));
    // An opaque hit ends the ray in its turn, not before.
    assert_eq!(ignore_all(&scene, along_z(4)), (vec![2.0, 3.0, 5.0], Some(6.0)));
}

#[test]
fn only_opaque_primitives_that_are_no_boxes_leave_nothing_to_shaders() {
    let decided = |geometries: Vec<Geometry>, flags: u32| {
        tlas(vec![instance(geometries)]).is_fully_opaque(RayFlags(flags))
    };
    let opaque = || triangles(&[1.0], OPAQUE);
    assert!(decided(vec![opaque()], 0) && decided(vec![opaque()], 1));
    assert!(!decided(vec![opaque()], 2), "the ray makes it non-opaque");
    assert!(!decided(vec![opaque(), triangles(&[2.0], NON_OPAQUE)], 0));
    assert!(!decided(vec![boxes(&[(1.0, 2.0)], OPAQUE)], 0));
    assert!(tlas(vec![]).is_fully_opaque(RayFlags(0)));
}

#[test]
fn confirming_ends_the_traversal_with_that_hit() {
    let scene = tlas(vec![instance(vec![triangles(&[5.0, 2.0], NON_OPAQUE), triangles(&[3.0], OPAQUE)])]);
    let mut cursor = Cursor::new(&scene, along_z(0));
    assert!(!cursor.confirm(), "nothing was handed out yet");
    let first = cursor.proceed(&scene).expect("the triangle at 2");
    assert_eq!(
        (first.hit_primitive(), cursor.t_max()),
        (HitPrimitive { instance: 0, geometry: 0, primitive: 1 }, 100.0)
    );
    assert!(!cursor.generate(2.0, HitKind(0)), "no box");
    assert!(cursor.confirm());
    assert_eq!(cursor.t_max(), 2.0);
    assert_eq!(cursor.proceed(&scene), None);
    assert_eq!(cursor.committed().map(|hit| (hit.t, hit.candidate)), Some((2.0, first)));
}

#[test]
fn ties_go_to_the_lowest_instance_then_geometry_then_primitive() {
    let same = || instance(vec![triangles(&[4.0], NON_OPAQUE), triangles(&[4.0, 4.0], NON_OPAQUE)]);
    let scene = tlas(vec![same(), same()]);
    let mut cursor = Cursor::new(&scene, along_z(0));
    let order: Vec<_> = std::iter::from_fn(|| cursor.proceed(&scene))
        .map(|c| (c.instance, c.geometry, c.primitive))
        .collect();
    assert_eq!(order, [(0, 0, 0), (0, 1, 0), (0, 1, 1), (1, 0, 0), (1, 1, 0), (1, 1, 1)]);
    let mut opaque = Cursor::new(&scene, along_z(1));
    assert_eq!(opaque.proceed(&scene), None);
    assert_eq!(opaque.committed().map(|hit| hit.candidate.hit_primitive()).unwrap().instance, 0);
    // A non-opaque primitive at the t of an opaque one has its turn if it is named first.
    let mixed = tlas(vec![instance(vec![
        triangles(&[4.0], NON_OPAQUE),
        triangles(&[4.0], OPAQUE),
        triangles(&[4.0], NON_OPAQUE),
    ])]);
    assert_eq!(ignore_all(&mixed, along_z(0)), (vec![4.0], Some(4.0)));
}

#[test]
fn triangles_are_open_to_the_interval_and_boxes_closed() {
    let scene = tlas(vec![
        instance(vec![triangles(&[2.0, 3.0, 4.0], NON_OPAQUE)]),
        instance(vec![boxes(&[(4.0, 5.0), (1.0, 2.0)], NON_OPAQUE)]),
    ]);
    let mut trace = along_z(0);
    trace.ray = trace.ray.with_interval(2.0, 4.0);
    // The box [1, 2] is entered before t_min and touched at it; [4, 5] is touched at t_max.
    assert_eq!(ignore_all(&scene, trace), (vec![2.0, 3.0, 4.0], None));
    let mut cursor = Cursor::new(&scene, trace);
    assert!(cursor.proceed(&scene).is_some_and(|c| c.is_box() && c.primitive == 1));
}

#[test]
fn reports_are_accepted_within_the_shrinking_interval() {
    let scene = tlas(vec![instance(vec![boxes(&[(1.0, 20.0), (6.0, 7.0), (8.0, 9.0)], NON_OPAQUE)])]);
    let mut cursor = Cursor::new(&scene, along_z(0));
    assert_eq!(cursor.proceed(&scene).map(|c| c.primitive), Some(0));
    assert!(!cursor.confirm(), "a box is not confirmed");
    for (t, accepted) in [(100.5, false), (f32::NAN, false), (-1.0, false), (10.0, true), (12.0, false)] {
        assert_eq!(cursor.generate(t, HitKind(1)), accepted, "{t}");
    }
    // The second report at the same t replaces the first.
    assert!(cursor.generate(7.5, HitKind(2)) && cursor.generate(7.5, HitKind(3)));
    assert_eq!((cursor.t_max(), cursor.committed().unwrap().hit_kind), (7.5, HitKind(3)));
    // The box at 6 can still hold a closer hit, the one at 8 cannot.
    assert_eq!(cursor.proceed(&scene).map(|c| c.primitive), Some(1));
    // At equal t the lower primitive stays.
    assert!(!cursor.accepts(7.5) && !cursor.generate(7.5, HitKind(4)));
    assert!(cursor.accepts(7.25));
    assert_eq!(cursor.proceed(&scene), None);
    assert_eq!(cursor.committed().map(|hit| (hit.t, hit.candidate.primitive)), Some((7.5, 0)));
}

/// An opaque hit behind the candidate is not known to its shader, whatever was visited; it takes
/// over in its turn.
#[test]
fn an_opaque_hit_has_its_turn_after_the_boxes_before_it() {
    let scene = tlas(vec![
        instance(vec![triangles(&[5.0], OPAQUE)]),
        instance(vec![boxes(&[(1.0, 20.0), (6.0, 7.0)], NON_OPAQUE)]),
    ]);
    let mut cursor = Cursor::new(&scene, along_z(0));
    assert_eq!(cursor.proceed(&scene).map(|c| c.primitive), Some(0));
    assert_eq!((cursor.t_max(), cursor.committed()), (100.0, None));
    assert!(cursor.generate(15.0, HitKind(1)));
    assert_eq!(cursor.proceed(&scene), None);
    assert_eq!(cursor.committed().map(|hit| hit.t), Some(5.0));
    // With TerminateOnFirstHit the generated hit is the first that is confirmed.
    cursor.reset(&scene, along_z(4));
    assert!(cursor.proceed(&scene).is_some() && cursor.generate(15.0, HitKind(1)));
    assert!(!cursor.generate(14.0, HitKind(1)), "the traversal is over");
    assert_eq!(cursor.proceed(&scene), None);
    assert_eq!(cursor.committed().map(|hit| hit.t), Some(15.0));
}

#[test]
fn terminating_keeps_what_was_committed() {
    let scene = tlas(vec![instance(vec![boxes(&[(1.0, 20.0), (2.0, 7.0)], NON_OPAQUE)])]);
    let mut cursor = Cursor::new(&scene, along_z(0));
    assert!(cursor.proceed(&scene).is_some() && cursor.generate(9.0, HitKind(1)));
    let mut copy = cursor.clone();
    cursor.terminate();
    assert_eq!((cursor.proceed(&scene), cursor.committed().map(|hit| hit.t)), (None, Some(9.0)));
    // A copy goes on by itself.
    assert_eq!(copy.proceed(&scene).map(|c| c.primitive), Some(1));
}

#[test]
fn facing_follows_the_winding_the_flip_and_the_geometry_transform_but_no_mirror() {
    let mirror = [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let kind = |geometry_transform, transform, flags| {
        let data =
            GeometryData::Triangles { vertices: triangle(3.0), indices: None, transform: geometry_transform };
        let scene = tlas(vec![TlasInstance {
            transform,
            flags: InstanceFlags(flags),
            ..instance(vec![Geometry::new(data, OPAQUE)])
        }]);
        let mut cursor = Cursor::new(&scene, along_z(0));
        assert_eq!(cursor.proceed(&scene), None);
        cursor.committed().map(|hit| hit.hit_kind)
    };
    let (plain, turned) = (kind(None, IDENTITY, 0), kind(None, IDENTITY, 2));
    assert_eq!(plain, Some(HitKind::BACK_FACING_TRIANGLE));
    assert_eq!(turned, Some(HitKind::FRONT_FACING_TRIANGLE));
    assert_eq!(kind(None, mirror, 0), plain, "a mirroring instance changes nothing");
    assert_eq!(kind(Some(mirror), IDENTITY, 0), turned, "a mirroring geometry transform turns it");
    assert_eq!(kind(Some(mirror), mirror, 2), plain);
}

#[test]
fn few_primitives_and_instances_build_nothing_and_unreached_blases_stay_unbuilt() {
    let scene = tlas(vec![
        TlasInstance { mask: 1, ..instance(vec![triangles(&[2.0], OPAQUE)]) },
        TlasInstance { mask: 2, ..instance(vec![triangles(&[3.0; 100], OPAQUE)]) },
    ]);
    let mut counters = Counters::default();
    let trace = TraceRay { cull_mask: 1, ..along_z(0) };
    let mut cursor = Cursor::new(&scene, trace);
    assert_eq!(cursor.proceed_observed(&scene, &mut counters), None);
    assert_eq!(counters, Counters { nodes: 0, instances: 2, primitives: 1, candidates: 0 });
    assert!(scene.instances()[0].blas.is_built() && !scene.instances()[1].blas.is_built());
}

/// Notes what it is told.
#[derive(Default)]
struct Notes {
    instances: Vec<(u32, InstanceVerdict)>,
    primitives: Vec<(u32, u32, PrimitiveVerdict)>,
    presented: Vec<Candidate>,
    committed: Vec<f32>,
    ends: Vec<bool>,
}

impl TraversalObserver for Notes {
    fn explains_misses(&self) -> bool {
        true
    }

    fn instance(&mut self, instance: u32, verdict: InstanceVerdict) {
        self.instances.push((instance, verdict));
    }

    fn primitive(&mut self, place: HitPrimitive, verdict: PrimitiveVerdict) {
        self.primitives.push((place.instance, place.primitive, verdict));
    }

    fn present(&mut self, candidate: &Candidate) {
        self.presented.push(*candidate);
    }

    fn commit(&mut self, committed: &anyhit_engine::accel::Committed) {
        self.committed.push(committed.t);
    }

    fn end(&mut self, complete: bool) {
        self.ends.push(complete);
    }
}

#[test]
fn an_onlooker_learns_why_each_was_kept_or_dropped() {
    let scene = tlas(vec![
        TlasInstance { mask: 0x10, ..instance(vec![triangles(&[1.0], OPAQUE)]) },
        instance(vec![boxes(&[(1.0, 2.0)], NON_OPAQUE)]),
        // Seen from its back, culled by bit 16 unless the flip turns it.
        instance(vec![triangles(&[2.0], OPAQUE)]),
        TlasInstance { flags: InstanceFlags(2), ..instance(vec![triangles(&[4.0, 200.0, 6.0], OPAQUE)]) },
    ]);
    let mut notes = Notes::default();
    let trace = TraceRay { cull_mask: 0x0F, ..along_z(16 | 512) };
    let mut cursor = Cursor::new(&scene, trace);
    assert_eq!(cursor.proceed_observed(&scene, &mut notes), None);
    use InstanceVerdict as I;
    let verdicts = [(0, I::Masked), (1, I::Skipped), (2, I::Entered), (3, I::Entered)];
    assert_eq!(notes.instances, verdicts);
    let of = |instance, primitive| {
        notes
            .primitives
            .iter()
            .find(|(i, p, _)| (*i, *p) == (instance, primitive))
            .map(|(.., verdict)| *verdict)
    };
    use PrimitiveVerdict as P;
    assert!(matches!(of(2, 0), Some(P::CulledByFace(found)) if found.t == 2.0));
    assert!(matches!(of(3, 0), Some(P::Opaque(found)) if found.t == 4.0));
    assert!(matches!(of(3, 1), Some(P::OutsideInterval(found)) if found.t == 200.0));
    assert!(matches!(of(3, 2), Some(P::Behind(found)) if found.t == 6.0));
    assert_eq!((notes.presented.len(), notes.committed, notes.ends), (0, vec![4.0], vec![true]));
}

#[test]
fn mistakes_are_named_with_their_rule() {
    let aabb = |corners| vec![Geometry::new(GeometryData::Aabbs(vec![corners]), OPAQUE)];
    let spheres = |radii: Vec<f32>, indices| {
        let positions = vec![[0.0; 3]; 2];
        vec![Geometry::new(GeometryData::Spheres { positions, radii, indices }, OPAQUE)]
    };
    let mesh = |vertices: usize, indices, transform| {
        let vertices = vec![[0.0; 3]; vertices];
        vec![Geometry::new(GeometryData::Triangles { vertices, indices, transform }, OPAQUE)]
    };
    let singular = [[1.0, 2.0, 3.0, 0.0], [2.0, 4.0, 6.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let mixed = vec![triangles(&[1.0], OPAQUE), boxes(&[(1.0, 2.0)], OPAQUE)];
    let rows = [
        (mixed, "geometry 1: AABBs in a BLAS of triangles", "03792"),
        (aabb([0.0, 1.0, 0.0, 1.0, 0.5, 1.0]), "primitive 0: minY 1 is not at most maxY 0.5", "minY-03547"),
        // Only a NaN in minX makes a box inactive.
        (aabb([0.0, f32::NAN, 0.0, 1.0, 1.0, 1.0]), "primitive 0: minY NaN is not", "minY-03547"),
        (aabb([0.0, 0.0, 0.0, f32::NAN, 1.0, 1.0]), "primitive 0: minX 0 is not", "minX-03546"),
        (spheres(vec![1.0, -2.0], None), "primitive 1 has the negative radius -2", "10436"),
        (spheres(vec![1.0], None), "2 positions with 1 radii", ""),
        (spheres(vec![1.0; 2], Some(vec![0, 2])), "indices[1] names position 2 of 2", ""),
        (mesh(4, None, None), "the number of vertices (4) is not a multiple of 3", ""),
        (mesh(3, Some(vec![0, 1]), None), "the number of indices (2) is not a multiple of 3", ""),
        (mesh(3, Some(vec![0, 1, 3]), None), "indices[2] names vertex 3 of 3", ""),
        (mesh(3, None, Some(singular)), "singular", "03799"),
    ];
    for (geometries, what, rule) in rows {
        let error = Blas::new(geometries).expect_err(what);
        assert_eq!(error.kind(), ErrorKind::InvalidScene);
        assert!(error.message().contains(what) && error.message().contains(rule), "{error}");
    }
    // A negative radius that nothing names is no mistake, nor is an inactive primitive.
    assert!(Blas::new(spheres(vec![1.0, -2.0], Some(vec![0]))).is_ok());
    assert!(Blas::new(spheres(vec![f32::NAN; 2], None)).is_ok());
    assert!(Blas::new(aabb([f32::NAN, 1.0, 0.0, 1.0, 0.5, 1.0])).is_ok());

    let placed = |change: fn(&mut TlasInstance)| {
        let mut one = instance(vec![triangles(&[1.0], OPAQUE)]);
        change(&mut one);
        Tlas::new(vec![one])
    };
    for (wrong, what) in [
        (placed(|i| i.custom_index = 1 << 24), "instance 0: custom index 16777216 has more than 24 bits"),
        (placed(|i| i.sbt_record_offset = 1 << 24), "SBT record offset 16777216 has more than 24 bits"),
        (placed(|i| i.flags = InstanceFlags(12)), "exclude each other"),
        (placed(|i| i.flags = InstanceFlags(0x100)), "flags 0x100 have more than 8 bits"),
        (placed(|i| i.transform[1][3] = f32::INFINITY), "not finite"),
        (placed(|i| i.transform[2] = [0.0; 4]), "singular"),
    ] {
        assert!(wrong.expect_err(what).message().contains(what));
    }
    assert!(placed(|i| i.custom_index = (1 << 24) - 1).is_ok());
    assert!(placed(|i| i.sbt_record_offset = (1 << 24) - 1).is_ok());
    assert!(placed(|i| i.flags = InstanceFlags(8)).is_ok());
}

/// The rule is VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03792.
#[test]
fn the_geometries_of_a_structure_are_of_one_kind() {
    let radii = vec![1.0; 2];
    let kinds = [
        triangles(&[1.0], OPAQUE),
        boxes(&[(1.0, 2.0)], OPAQUE),
        Geometry::new(GeometryData::Spheres { positions: vec![[0.0; 3]; 2], radii, indices: None }, OPAQUE),
    ];
    for (one, first) in kinds.iter().enumerate() {
        for (other, second) in kinds.iter().enumerate() {
            let found = Blas::new(vec![first.clone(), second.clone()]).map(|_| ());
            let found = found.map_err(|error| error.message().contains("type-03792"));
            assert_eq!(found, if one == other { Ok(()) } else { Err(true) }, "{one} beside {other}");
        }
    }
}

/// What moves is hit where still copies of it are, made of the keys between which it is at a ray's
/// time: so no box loses it, with trees over instances and triangles.
#[test]
fn what_moves_is_where_it_is_at_the_time_of_a_ray() {
    let mut state = 7u64;
    let mut next = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32 * 2.0 - 1.0
    };
    let mut hits = 0;
    for _ in 0..6 {
        let vertices: Vec<[f32; 3]> = (0..60).map(|_| [next(), next(), next()]).collect();
        let later: Vec<[f32; 3]> = vertices.iter().map(|v| v.map(|x| x + 0.5 * next())).collect();
        let still = GeometryData::Triangles { vertices: vertices.clone(), indices: None, transform: None };
        let moving = Geometry { vertices_t1: Some(later.into()), ..Geometry::new(still, OPAQUE) };
        let balls = Geometry::new(
            GeometryData::Spheres { positions: vertices[..20].to_vec(), radii: vec![0.1; 20], indices: None },
            OPAQUE,
        );
        let mut srt = || Srt {
            scale: [1.0 + 0.3 * next(), 1.0 + 0.3 * next(), 1.0 + 0.3 * next()],
            shear: [0.2 * next(), 0.2 * next(), 0.2 * next()],
            pivot: [2.0 * next(), 0.0, next()],
            quaternion: [next(), next(), next(), 1.5],
            translation: [4.0 * next(), 4.0 * next(), 4.0 * next()],
        };
        let instances: Vec<TlasInstance> = (0..12)
            .map(|at| {
                let motion = Motion::Srt(Box::new([srt(), srt()]));
                let ends = [0.0, 1.0].map(|time| motion.at(time).expect("a rotation"));
                let geometry = if at % 2 == 0 { moving.clone() } else { balls.clone() };
                let motion = match at % 3 {
                    0 => Some(motion),
                    1 => Some(Motion::Matrix(ends)),
                    _ => None,
                };
                TlasInstance { transform: ends[0], motion, ..instance(vec![geometry]) }
            })
            .collect();
        let moved = tlas(instances.clone());
        for time in [0.0, 0.125, 0.5, 0.77, 1.0] {
            let at_time = |one: &TlasInstance| {
                let geometry = &one.blas.geometries()[0];
                let data = match &geometry.vertices_t1 {
                    Some(_) => {
                        let corners = (0..20).flat_map(|at| match geometry.primitive_at(at, time) {
                            Primitive::Triangle(corners) => corners,
                            other => panic!("{other:?}"),
                        });
                        GeometryData::Triangles {
                            vertices: corners.collect(),
                            indices: None,
                            transform: None,
                        }
                    }
                    None => geometry.data.clone(),
                };
                let transform = one.object_to_world(time);
                TlasInstance { transform, motion: None, ..instance(vec![Geometry::new(data, OPAQUE)]) }
            };
            let copied = tlas(instances.iter().map(at_time).collect());
            for _ in 0..200 {
                let origin = [9.0 * next(), 9.0 * next(), 9.0];
                let target = [5.0 * next(), 5.0 * next(), 5.0 * next()];
                let direction = std::array::from_fn(|axis| target[axis] - origin[axis]);
                let trace =
                    TraceRay { ray: Ray::new(origin, direction), flags: RayFlags(0), cull_mask: 0xFF, time };
                let find = |scene: &Arc<Tlas>| {
                    let mut cursor = Cursor::new(scene, trace);
                    while cursor.proceed(scene).is_some() {}
                    cursor.committed().map(|hit| {
                        let candidate = hit.candidate;
                        (
                            hit.t,
                            candidate.hit_primitive(),
                            candidate.intersection,
                            candidate.primitive_in(scene, time),
                        )
                    })
                };
                let found = find(&moved);
                assert_eq!(found, find(&copied), "{trace:?}");
                hits += usize::from(found.is_some());
            }
        }
    }
    assert!(hits > 1000, "{hits} hits");
}

#[test]
fn motion_has_rules() {
    let refused =
        |one: TlasInstance| Tlas::new(vec![one]).map(|_| ()).expect_err("a mistake").message().to_owned();
    let one = || instance(vec![triangles(&[2.0], OPAQUE)]);
    let flat = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0; 4]];
    let told = refused(TlasInstance { motion: Some(Motion::Matrix([IDENTITY, flat])), ..one() });
    assert!(told.contains("at time 1 is singular"), "{told}");
    let mut infinite = IDENTITY;
    infinite[0][3] = f32::INFINITY;
    let told = refused(TlasInstance { motion: Some(Motion::Matrix([infinite, IDENTITY])), ..one() });
    assert!(told.contains("not finite"), "{told}");
    let two = triangles(&[1.0, 2.0], OPAQUE);
    let few = Geometry { vertices_t1: Some(vec![[0.0; 3]; 3].into()), ..two };
    let told = Blas::new(vec![few]).expect_err("a mistake").message().to_owned();
    assert!(told.contains("3 vertices at time 1, but 6 at time 0"), "{told}");
    let box_moves = Geometry { vertices_t1: Some(Vec::new().into()), ..boxes(&[(0.0, 1.0)], OPAQUE) };
    let told = Blas::new(vec![box_moves]).expect_err("a mistake").message().to_owned();
    assert!(told.contains("only triangles can move"), "{told}");
    // Half way between the identity and its mirror image there is no inverse: the instance is not
    // there.
    let mut mirrored = IDENTITY;
    mirrored[0][0] = -1.0;
    let scene = tlas(vec![TlasInstance { motion: Some(Motion::Matrix([IDENTITY, mirrored])), ..one() }]);
    for (time, hit) in [(0.0, true), (0.5, false), (1.0, true)] {
        let trace = TraceRay { time, ..along_z(0) };
        let mut cursor = Cursor::new(&scene, trace);
        while cursor.proceed(&scene).is_some() {}
        assert_eq!(cursor.committed().is_some(), hit, "at {time}");
    }
}

#[test]
fn many_instances_of_nothing_are_hit_by_nothing() {
    let nothing = Geometry::new(
        GeometryData::Spheres { positions: vec![[0.0, 0.0, 1.0]], radii: vec![0.0], indices: None },
        OPAQUE,
    );
    for geometries in [vec![], vec![nothing]] {
        let blas = Blas::new(geometries).unwrap();
        let scene = tlas(vec![TlasInstance::of(blas, IDENTITY); 9]);
        for flags in [0, 2] {
            assert_eq!(ignore_all(&scene, along_z(flags)), (vec![], None));
        }
        let mut hits = Vec::new();
        assert!(Packet::default().trace(&scene, &[along_z(0); 16], false, &mut hits));
        assert_eq!(hits, [None; 16]);
    }
}
