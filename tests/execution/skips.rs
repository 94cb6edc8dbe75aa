//! What a scene does not need is not done, and `--stats` counts it.

use std::process::Command;
use std::sync::Arc;

use anyhit::{Program, Ray, Result};
use anyhit_engine::accel::{
    Blas, Candidate, Committed, Counters, Cursor, EndCaps, Geometry, GeometryData, GeometryFlags,
    HitPrimitive, Indexing, InstanceVerdict, PrimitiveVerdict, RayFlags, TestCounts, Tlas, TlasInstance,
    TraceRay, TraversalObserver,
};
use anyhit_engine::machine::Resources;
use anyhit_engine::math::random::Random;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::{Launch, Pipeline, RayOperands, Stats};

use crate::support::assembly;

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Spheres of radius 1/4 in a row along x, one a unit, the first at 0.
fn spheres(count: usize, flags: GeometryFlags) -> Arc<Blas> {
    let positions = (0..count).map(|at| [at as f32, 0.0, 0.0]).collect();
    let data = GeometryData::Spheres { positions, radii: vec![0.25; count], indices: None };
    Blas::new(vec![Geometry::new(data, flags)]).expect("legal spheres")
}

fn instance(blas: &Arc<Blas>, y: f32) -> TlasInstance {
    let mut transform = IDENTITY;
    transform[1][3] = y;
    TlasInstance::of(blas.clone(), transform)
}

/// A ray down onto the sphere in column x of row y.
fn ray(x: f32, y: f32) -> TraceRay {
    let ray = Ray::new([x, y, 4.0], [0.0, 0.0, -1.0]);
    TraceRay { ray, flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 }
}

fn walk(tlas: &Tlas, trace: TraceRay) -> Counters {
    let mut counters = Counters::default();
    let mut cursor = Cursor::new(tlas, trace);
    while cursor.proceed_observed(tlas, &mut counters).is_some() {}
    counters
}

#[test]
fn a_few_primitives_have_no_tree() -> Result<()> {
    for (count, has_tree) in [(1, false), (4, false), (5, true)] {
        let blas = spheres(count, GeometryFlags::OPAQUE);
        let tlas = Tlas::new(vec![instance(&blas, 0.0)])?;
        assert!(!blas.is_built(), "nothing is built before the first ray");
        let counters = walk(&tlas, ray(0.0, 0.0));
        assert!(blas.is_built());
        assert_eq!(blas.has_bvh(), has_tree, "{count} primitives");
        assert_eq!(counters.nodes > 0, has_tree, "{count} primitives");
    }
    Ok(())
}

#[test]
fn a_few_rays_have_no_tree() -> Result<()> {
    let blas = spheres(1000, GeometryFlags::OPAQUE);
    let tlas = Tlas::new(vec![instance(&blas, 0.0)])?;
    assert!(!blas.is_built(), "nothing is built before the first ray");
    let of_first = walk(&tlas, ray(999.0, 0.0));
    assert!(blas.is_built() && blas.is_listed() && !blas.has_bvh());
    // All are looked through.
    assert_eq!((of_first.nodes, of_first.primitives), (0, 1000));
    let mut rays = 1;
    while !blas.has_bvh() {
        rays += 1;
        assert!(rays < 100, "no tree comes after {rays} rays");
        walk(&tlas, ray(0.0, 0.0));
    }
    assert!(rays > 4, "a tree comes with ray {rays}");
    assert!(blas.is_built() && !blas.is_listed(), "the list is no longer needed");
    let of_last = walk(&tlas, ray(999.0, 0.0));
    assert!(of_last.nodes > 0 && of_last.primitives < 20, "{of_last:?}");
    Ok(())
}

/// A ray whose direction is zero tests no primitive but boxes, and of these only what its origin is
/// near to, whatever the transform.
#[test]
fn a_ray_that_goes_nowhere_tests_boxes_alone() -> Result<()> {
    let mut turned = IDENTITY;
    turned[0] = [0.3, -0.7, 0.1, 0.0];
    turned[1] = [0.7, 0.3, 0.2, 0.0];
    let along: Vec<[f32; 3]> = (0..1000).map(|at| [at as f32, 0.0, 0.0]).collect();
    let surfaces = [
        GeometryData::Spheres { positions: along.clone(), radii: vec![0.25; 1000], indices: None },
        GeometryData::LinearSweptSpheres {
            positions: along.clone(),
            radii: vec![0.25; 1000],
            indices: Some((0..999).collect()),
            indexing: Indexing::Successive,
            end_caps: EndCaps::Chained,
        },
        GeometryData::Triangles { vertices: along[..999].to_vec(), indices: None, transform: None },
    ];
    let here = |origin: [f32; 3], direction: [f32; 3]| TraceRay {
        ray: Ray::new(origin, direction),
        ..ray(0.0, 0.0)
    };
    for data in surfaces {
        let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)])?;
        for matrix in [IDENTITY, turned] {
            let tlas = Tlas::new(vec![TlasInstance::of(blas.clone(), matrix)])?;
            for direction in [[0.0; 3], [-0.0, 0.0, -0.0]] {
                // The first rays look through a list, later ones through a tree.
                for _ in 0..40 {
                    let counters = walk(&tlas, here([0.0; 3], direction));
                    assert_eq!((counters.nodes, counters.primitives), (0, 0), "{matrix:?}");
                }
            }
        }
    }
    let boxes = (0..1000).map(|at| {
        let low = 2.0 * at as f32;
        [low, -0.5, -0.5, low + 1.0, 0.5, 0.5]
    });
    let data = GeometryData::Aabbs(boxes.collect());
    let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)])?;
    for matrix in [IDENTITY, turned] {
        let tlas = Tlas::new(vec![TlasInstance::of(blas.clone(), matrix)])?;
        // The middle of a box in world space, and a point between two boxes.
        let at = |x: f32| [0, 1, 2].map(|row: usize| matrix[row][0] * x + matrix[row][3]);
        for _ in 0..40 {
            walk(&tlas, here(at(14.5), [0.0; 3]));
        }
        assert!(blas.has_bvh());
        let counters = walk(&tlas, here(at(14.5), [0.0; 3]));
        assert_eq!(counters.candidates, 1, "{matrix:?}");
        assert!(counters.primitives <= 8, "{matrix:?}: {counters:?}");
        assert_eq!(walk(&tlas, here(at(15.5), [0.0; 3])).candidates, 0, "{matrix:?}");
    }
    Ok(())
}

#[test]
fn only_what_a_ray_reaches_is_built() -> Result<()> {
    // More instances than are looked at without a tree over them: that needs the box around each
    // BLAS and nothing else of it.
    let parts: Vec<_> = (0..6).map(|_| spheres(5, GeometryFlags::OPAQUE)).collect();
    let rows = parts.iter().enumerate().map(|(row, blas)| instance(blas, 2.0 * row as f32));
    let tlas = Tlas::new(rows.collect())?;
    walk(&tlas, ray(3.0, 4.0));
    let built: Vec<bool> = parts.iter().map(|blas| blas.is_built()).collect();
    assert_eq!(built, [false, false, true, false, false, false]);
    // A box that is known beforehand is that of the built primitives.
    let bounds = parts[0].bounds();
    assert!(!parts[0].is_built());
    walk(&tlas, ray(3.0, 0.0));
    assert!(parts[0].is_built() && parts[0].bounds() == bounds);
    Ok(())
}

/// Writes down all that a traversal tells, with the reason why each primitive is missed.
#[derive(Default)]
struct Explanation(Vec<String>);

impl TraversalObserver for Explanation {
    fn explains_misses(&self) -> bool {
        true
    }

    fn node(&mut self, instance: Option<u32>) {
        self.0.push(format!("node of {instance:?}"));
    }

    fn instance(&mut self, instance: u32, verdict: InstanceVerdict) {
        self.0.push(format!("instance {instance}: {verdict:?}"));
    }

    fn primitive(&mut self, primitive: HitPrimitive, verdict: PrimitiveVerdict) {
        self.0.push(format!("{primitive:?}: {verdict:?}"));
    }

    fn commit(&mut self, committed: &Committed) {
        self.0.push(format!("commit {committed:?}"));
    }
}

/// What an explained traversal tells, which ignores every candidate.
fn explain(tlas: &Tlas, trace: TraceRay) -> Vec<String> {
    let mut told = Explanation::default();
    let mut cursor = Cursor::new(tlas, trace);
    while cursor.proceed_observed(tlas, &mut told).is_some() {}
    told.0
}

/// 3,000 primitives at random places of a cube around the origin, of a kind.
fn crowd(kind: usize, flags: GeometryFlags) -> Arc<Blas> {
    let mut random = Random::new(kind as u64);
    let mut point = |size: f32| [0; 3].map(|_| size * (random.unit() - 0.5));
    let data = match kind {
        0 => GeometryData::Triangles {
            vertices: (0..3000)
                .flat_map(|_| {
                    let at = point(8.0);
                    [0; 3].map(|_| {
                        let by = point(0.5);
                        [0, 1, 2].map(|axis| at[axis] + by[axis])
                    })
                })
                .collect(),
            indices: None,
            transform: None,
        },
        1 => GeometryData::Aabbs(
            (0..3000)
                .map(|_| {
                    let [x, y, z] = point(8.0);
                    [x, y, z, x + 0.2, y + 0.1, z + 0.3]
                })
                .collect(),
        ),
        2 => GeometryData::Spheres {
            positions: (0..3000).map(|_| point(8.0)).collect(),
            radii: vec![0.1; 3000],
            indices: None,
        },
        // Long and dense, so that each is in two leaves.
        _ => GeometryData::LinearSweptSpheres {
            positions: (0..6000).map(|_| point(8.0)).collect(),
            radii: vec![0.01; 6000],
            indices: None,
            indexing: Indexing::List,
            end_caps: EndCaps::Chained,
        },
    };
    Blas::new(vec![Geometry::new(data, flags)]).expect("legal primitives")
}

/// Rays through the middle of a crowd: from inside, where a ray begins in several boxes at once,
/// and from outside.
fn rays_through_a_crowd() -> Vec<TraceRay> {
    let mut random = Random::new(3);
    let mut point = |size: f32| [0; 3].map(|_| size * (random.unit() - 0.5));
    let rays = (0..60).map(|at| {
        let origin = point(if at % 2 == 0 { 6.0 } else { 20.0 });
        let to = point(6.0);
        let direction = [0, 1, 2].map(|axis| to[axis] - origin[axis]);
        TraceRay { ray: Ray::new(origin, direction), ..ray(0.0, 0.0) }
    });
    rays.collect()
}

/// Counts are those of an explained ray: of whole leaves, of primitives that are split, and of
/// those that the ray's flags cull.
#[test]
fn counts_are_those_of_an_explained_ray() -> Result<()> {
    const FLAGS: [RayFlags; 5] = [
        RayFlags(0),
        RayFlags::CULL_OPAQUE,
        RayFlags::CULL_NO_OPAQUE,
        RayFlags::TERMINATE_ON_FIRST_HIT,
        RayFlags::CULL_BACK_FACING_TRIANGLES,
    ];
    let mut turned = IDENTITY;
    turned[0] = [0.3, -0.7, 0.1, 0.5];
    let crowds = (0..4).flat_map(|kind| {
        [GeometryFlags::OPAQUE, GeometryFlags::default()].map(|flags| (kind, crowd(kind, flags)))
    });
    let few = spheres(7, GeometryFlags::default());
    for (kind, blas) in crowds.chain([(4, few)]) {
        for matrix in [IDENTITY, turned] {
            let tlas = Tlas::new(vec![TlasInstance::of(blas.clone(), matrix)])?;
            let mut sum = TestCounts::default();
            for flags in FLAGS {
                for one in rays_through_a_crowd() {
                    let trace = TraceRay { flags, ..one };
                    let told = explain(&tlas, trace);
                    let lines =
                        |begin: &str| told.iter().filter(|line| line.starts_with(begin)).count() as u64;
                    let wanted = TestCounts { nodes: lines("node"), primitives: lines("HitPrimitive") };
                    let (mut counts, mut cursor) = (TestCounts::default(), Cursor::new(&tlas, trace));
                    while cursor.proceed_counted(&tlas, &mut counts).is_some() {}
                    assert_eq!(counts, wanted, "kind {kind}, flags {flags:?}, {:?}", trace.ray);
                    sum.nodes += counts.nodes;
                    sum.primitives += counts.primitives;
                }
            }
            assert!(kind == 4 || sum.nodes > 100 && sum.primitives > 100, "kind {kind}: {sum:?}");
        }
    }
    Ok(())
}

/// A ray that is explained sees in the parts that are built for it what it sees in the whole BVH,
/// whatever rays came before it.
#[test]
fn an_explained_ray_is_told_the_same_of_a_part() -> Result<()> {
    let rays = rays_through_a_crowd();
    let mut turned = IDENTITY;
    turned[0] = [0.3, -0.7, 0.1, 0.5];
    turned[1] = [0.7, 0.3, 0.2, 0.0];
    for kind in 0..4 {
        for flags in [GeometryFlags::OPAQUE, GeometryFlags::default()] {
            for matrix in [IDENTITY, turned] {
                let tlas = |blas: &Arc<Blas>| Tlas::new(vec![TlasInstance::of(blas.clone(), matrix)]);
                let whole = crowd(kind, flags);
                let of_whole = tlas(&whole)?;
                while !whole.has_bvh() {
                    // Rays whose traversal is not explained build the whole.
                    for &one in &rays {
                        walk(&of_whole, one);
                    }
                }
                let wanted: Vec<Vec<String>> = rays.iter().map(|&one| explain(&of_whole, one)).collect();
                assert!(wanted.iter().any(|told| told.iter().any(|line| line.starts_with("node"))));
                for backwards in [false, true] {
                    let part = crowd(kind, flags);
                    let of_part = tlas(&part)?;
                    let mut order: Vec<usize> = (0..rays.len()).collect();
                    if backwards {
                        order.reverse();
                    }
                    for at in order {
                        assert_eq!(explain(&of_part, rays[at]), wanted[at], "kind {kind}, ray {at}");
                    }
                    assert!(part.is_built() && !part.has_bvh() && !part.is_listed());
                }
            }
        }
    }
    Ok(())
}

/// Many rays that are explained build the whole BVH, and so do others beside them.
#[test]
fn many_explained_rays_build_the_whole() -> Result<()> {
    let blas = crowd(2, GeometryFlags::OPAQUE);
    let tlas = Tlas::new(vec![TlasInstance::of(blas.clone(), IDENTITY)])?;
    let along = TraceRay { ray: Ray::new([-9.0, 0.0, 0.0], [1.0, 0.0, 0.0]), ..ray(0.0, 0.0) };
    let wanted = explain(&tlas, along);
    let mut rays = 1;
    while !blas.has_bvh() {
        rays += 1;
        assert!(rays < 1000, "no whole BVH comes after {rays} rays");
        assert_eq!(explain(&tlas, along), wanted);
    }
    assert!(rays > 32, "the whole BVH comes with ray {rays}");
    assert_eq!(explain(&tlas, along), wanted);
    Ok(())
}

/// A traversal that begins in a part goes on there, whether or not it is observed then.
#[test]
fn a_traversal_that_is_no_longer_observed_goes_on_in_its_part() -> Result<()> {
    let tlas = Tlas::new(vec![TlasInstance::of(crowd(1, GeometryFlags::default()), IDENTITY)])?;
    let candidates = |row: u8| -> (TraceRay, Vec<Candidate>) {
        let origin = [-9.0, 0.05 * f32::from(row) - 3.0, 0.0];
        let along = TraceRay { ray: Ray::new(origin, [1.0, 0.01, 0.02]), ..ray(0.0, 0.0) };
        let mut cursor = Cursor::new(&tlas, along);
        (along, std::iter::from_fn(|| cursor.proceed(&tlas)).collect())
    };
    let (along, all) = (0..120).map(candidates).max_by_key(|(_, all)| all.len()).expect("some rays");
    assert!(all.len() > 2, "no ray meets many boxes");
    for observed in 1..all.len() {
        let blas = crowd(1, GeometryFlags::default());
        let tlas = Tlas::new(vec![TlasInstance::of(blas.clone(), IDENTITY)])?;
        let mut cursor = Cursor::new(&tlas, along);
        let mut told = Explanation::default();
        let mut found: Vec<Candidate> = Vec::new();
        while let Some(one) = match found.len() < observed {
            true => cursor.proceed_observed(&tlas, &mut told),
            false => cursor.proceed(&tlas),
        } {
            found.push(one);
        }
        assert_eq!(found, all, "{observed} were observed");
        assert!(!blas.has_bvh());
    }
    Ok(())
}

#[test]
fn a_masked_or_skipped_instance_is_never_built() -> Result<()> {
    let blas = spheres(5, GeometryFlags::OPAQUE);
    let tlas = Tlas::new(vec![TlasInstance { mask: 1, ..instance(&blas, 0.0) }])?;
    walk(&tlas, TraceRay { cull_mask: 2, ..ray(0.0, 0.0) });
    // Spheres are skipped with triangles (SPV_NV_linear_swept_spheres, SkipBuiltinPrimitivesNV).
    walk(&tlas, TraceRay { flags: RayFlags(256), ..ray(0.0, 0.0) });
    assert!(!blas.is_built());
    Ok(())
}

#[test]
fn a_ray_that_asks_only_whether_stops_at_the_first_hit() -> Result<()> {
    // Looked along, the row has 100 spheres one behind the other.
    let blas = spheres(100, GeometryFlags::OPAQUE);
    let tlas = Tlas::new(vec![instance(&blas, 0.0)])?;
    let along = Ray::new([-4.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let trace = TraceRay { ray: along, ..ray(0.0, 0.0) };
    let mut counters = Counters::default();
    let mut cursor = Cursor::new(&tlas, trace);
    cursor.end_at_any_opaque_hit();
    assert!(cursor.proceed_observed(&tlas, &mut counters).is_none());
    assert!(cursor.committed().is_some());
    // One leaf of at most four primitives, whichever it is.
    assert!(counters.primitives <= 4, "{counters:?}");
    Ok(())
}

/// A shader of a stage, by its body.
fn shader(stage: &str, declarations: &str, body: &str) -> Program {
    let interface = if declarations.contains("%seen ") { "%seen" } else { "" };
    let text = format!(
        "OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint {stage} %main \"main\" {interface}
         {declarations}
         %void = OpTypeVoid
         %function = OpTypeFunction %void
         %main = OpFunction %void None %function
         %start = OpLabel
         {body}
         OpReturn
         OpFunctionEnd"
    );
    let module = Arc::new(anyhit_engine::module::load(&assembly::assemble(&text)).expect("a module"));
    Program::of(&module, "main").expect("a shader")
}

const PRIMITIVE: &str = "OpDecorate %seen BuiltIn PrimitiveId
     %uint = OpTypeInt 32 0
     %one = OpConstant %uint 1
     %pointer = OpTypePointer Input %uint
     %seen = OpVariable %pointer Input";

#[test]
fn what_no_output_reads_is_neither_loaded_nor_computed() {
    // A builtin is loaded and added to, and the sum goes nowhere: two operations at most, and the
    // builtin, are eliminated. (A load of a builtin may be no operation at all.)
    let body = "%value = OpLoad %uint %seen
         %sum = OpIAdd %uint %value %one";
    let idle = shader("ClosestHitKHR", PRIMITIVE, body);
    assert!((1..=2).contains(&idle.eliminated.operations), "{:?}", idle.eliminated);
    assert_eq!(idle.eliminated.builtins, 1);
    assert!(idle.ops.is_empty() && idle.inputs.is_empty() && idle.is_empty());
    let nothing = shader("ClosestHitKHR", "", "");
    assert_eq!((nothing.eliminated.operations, nothing.eliminated.builtins), (0, 0));
    assert!(nothing.is_empty());
}

/// One ray onto the first of five spheres, through a hit group.
fn trace(group: impl IntoIterator<Item = Program>, flags: GeometryFlags, x: f32) -> Result<Stats> {
    launch(group, flags, ray(x, 0.0))
}

/// One ray onto five spheres, through a hit group.
fn launch(group: impl IntoIterator<Item = Program>, flags: GeometryFlags, trace: TraceRay) -> Result<Stats> {
    let pipeline = Pipeline::builder().hit(group)?.miss(shader("MissKHR", "", ""))?.build()?;
    let (pipeline, resources) = (pipeline, Resources::default());
    let tlas = Tlas::new(vec![instance(&spheres(5, flags), 0.0)])?;
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    let payload = Vec::new();
    let (sbt_offset, sbt_stride, miss_index) = (0, 0, 0);
    let operands = RayOperands { trace, sbt_offset, sbt_stride, miss_index, payload };
    Ok(launch.trace(&tlas, operands, None)?.stats)
}

/// An any-hit shader that ignores every hit.
fn ignoring() -> Program {
    let text = "OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint AnyHitKHR %main \"main\"
         %void = OpTypeVoid
         %function = OpTypeFunction %void
         %main = OpFunction %void None %function
         %start = OpLabel
         OpIgnoreIntersectionKHR
         OpFunctionEnd";
    let module = Arc::new(anyhit_engine::module::load(&assembly::assemble(text)).expect("a module"));
    Program::of(&module, "main").expect("a shader")
}

#[test]
fn rays_that_go_nowhere_are_counted() -> Result<()> {
    for (direction, nowhere) in [([0.0; 3], 1), ([0.0, -0.0, 0.0], 1), ([0.0, 0.0, -1e-30], 0)] {
        let trace = TraceRay { ray: Ray::new([0.0, 0.0, 4.0], direction), ..ray(0.0, 0.0) };
        let stats = launch([shader("ClosestHitKHR", "", "")], GeometryFlags::OPAQUE, trace)?;
        assert_eq!((stats.rays, stats.zero_directions), (1, nowhere), "{direction:?}");
        assert_eq!(stats.shaders.contains_key(&Stage::Miss), nowhere == 1, "{direction:?}: {stats:?}");
    }
    Ok(())
}

#[test]
fn opaque_geometry_never_asks_any_hit() -> Result<()> {
    let opaque = trace([ignoring()], GeometryFlags::OPAQUE, 0.0)?;
    assert!(!opaque.shaders.contains_key(&Stage::AnyHit), "{opaque:?}");
    assert_eq!(opaque.elided.any_hit, 1);
    let asked = trace([ignoring()], GeometryFlags::default(), 0.0)?;
    assert_eq!(asked.shaders[&Stage::AnyHit].invocations, 1);
    // The hit was ignored: the ray goes on to the miss shader.
    assert_eq!((asked.elided.any_hit, asked.shaders[&Stage::Miss].invocations), (0, 1));
    Ok(())
}

#[test]
fn shaders_that_leave_nothing_behind_are_counted_and_not_run() -> Result<()> {
    // A closest-hit shader without a payload, effects or traps cannot be observed.
    let hit = trace([shader("ClosestHitKHR", "", "")], GeometryFlags::OPAQUE, 0.0)?;
    let ran = hit.shaders[&Stage::ClosestHit];
    assert_eq!((ran.invocations, ran.batches, hit.elided.empty), (1, 0, 1));
    let miss = trace([shader("ClosestHitKHR", "", "")], GeometryFlags::OPAQUE, 0.5)?;
    assert_eq!((miss.shaders[&Stage::Miss].batches, miss.elided.empty), (0, 1));
    // An empty any-hit shader accepts; the closest-hit shader is not run either.
    let group = [shader("AnyHitKHR", "", ""), shader("ClosestHitKHR", "", "")];
    let both = trace(group, GeometryFlags::default(), 0.0)?;
    assert_eq!((both.shaders[&Stage::AnyHit].invocations, both.elided.empty), (1, 2));
    assert_eq!(both.shaders[&Stage::ClosestHit].invocations, 1);
    Ok(())
}

#[test]
fn the_command_tells_what_was_elided() {
    let picture = std::env::temp_dir().join(format!("anyhit-skips-{}.png", std::process::id()));
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .args(["render", "scenes/swept-spheres.toml", "--size", "32x18", "--stats", "-o"])
        .arg(&picture)
        .output()
        .expect("the program starts");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    for words in [
        "were reached by rays and built",
        // Grass and chains, spheres, the ground; the scene has no box.
        "(linear swept spheres, spheres, triangles)",
        "instances",
        "occlusion rays that ended at the first hit found",
        "that no output depends on",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    std::fs::remove_file(&picture).expect("the picture goes away");
}
