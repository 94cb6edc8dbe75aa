//! Time against error of intersection tests: each primitive and each scene under each precision and
//! under formulas as they are published.
//!
//! ```sh
//! cargo bench --bench time_vs_error              # all; records and draws docs/time-vs-error.svg
//! cargo bench --bench time_vs_error -- --draw    # draws the recorded values
//! cargo bench --bench time_vs_error -- --quick   # a look; writes target/time-vs-error.svg
//! cargo bench --bench time_vs_error -- grass     # scenes whose names begin so; draws nothing
//! ```
//!
//! All contenders share rays, tree, leaf loop and the four-wide test of a leaf (their own formula
//! in it), compiled for the instruction set of the processor. They take turns in changing order,
//! several rounds in one run, with several copies of their primitives, once unmeasured for the
//! caches and once more; times are processor time of one thread, medians over the rounds, and so
//! are the ratios to the exact mode within a round. "engine" is the traversal that shaders get
//! ([`anyhit_engine::accel::Cursor`]). Errors are judged by rational arithmetic on a part of
//! the rays.

#![allow(clippy::print_stdout, reason = "a table is printed")]

mod contender;
#[path = "../figure/mod.rs"]
mod figure;
mod judge;
mod pass;
mod plot;
mod scene;
mod shape;
mod steps;
mod textbook;
mod tree;

use std::path::PathBuf;
use std::time::Duration;

use anyhit_engine::accel::{Blas, Cursor, RayFlags, Tlas, TlasInstance, TraceRay};
use anyhit_engine::geometry::block::{self, ShearedRay};
use anyhit_engine::geometry::{Precision, Ray};
use anyhit_engine::math::lane_ops::CpuTier;

use contender::{Contender, DOUBLE, EXACT, ExactTriangles, FLOAT, Ours};
use judge::Errors;
use pass::{ContenderScene, Hit, SceneBvhs, TracePass};
use plot::{Panel, Point};
use scene::Scene;
use shape::Shape;
use textbook::{CapsuleByDistance, MoellerTrumbore, NaiveSphere, RecentredSphere, RoundCone, Slabs, Woop};

/// How often each copy of a contender runs.
const ROUNDS: usize = 9;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let record = root.join("benches/time_vs_error/recorded.tsv");
    if std::env::args().any(|argument| argument == "--draw") {
        return plot::draw_recorded(&record, &root.join("docs/time-vs-error.svg"));
    }
    let quick = std::env::args().any(|argument| argument == "--quick");
    let chosen: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let is_chosen = |name: &str| chosen.is_empty() || chosen.iter().any(|begin| name.starts_with(begin));
    let copies = if quick { 1 } else { 7 };
    let judged = if quick { 60 } else { 1000 };
    let mut panels = Vec::new();
    for scene in scene::scenes(quick).into_iter().filter(|scene| is_chosen(scene.name)) {
        let truth = judge::reference_hits(&scene, judged);
        let trees = SceneBvhs::of(&scene);
        assert!(ShearedRay::covers(&scene.bounds), "as traversals know it of a tree");
        // The addresses of the blocks in memory change the time by a few percent.
        let mut copies: Vec<_> = (0..copies).map(|_| contenders(&scene, &trees)).collect();
        let contenders: Vec<&str> = copies[0].iter().map(|(name, _)| *name).collect();
        let mut times = vec![Vec::new(); contenders.len()];
        let mut hits: Vec<Vec<Hit>> = vec![Vec::new(); contenders.len()];
        for round in 0..ROUNDS * copies.len() {
            let copy = round % copies.len();
            for place in order(round, contenders.len()) {
                let run = &mut copies[copy][place].1;
                // The first run is not measured: it fills the caches, whatever the previous
                // contender left in them.
                hits[place].clear();
                run(&scene.rays, &mut hits[place]);
                hits[place].clear();
                let begin = thread_time();
                run(&scene.rays, &mut hits[place]);
                times[place].push((thread_time() - begin).as_nanos() as f64 / scene.rays.len() as f64);
            }
        }
        let hit_count = truth.iter().filter(|truth| truth.hit.is_some()).count();
        println!(
            "\n{}: {} primitives, {} instances, {} rays, {} of {} judged hit; {}",
            scene.name,
            scene.shapes.len(),
            scene.matrices.len(),
            scene.rays.len(),
            hit_count,
            truth.len(),
            steps::steps(&scene, &trees)
        );
        println!(
            "  {:<22} {:>8} {:>7} {:>9} {:>9} {:>9} {:>11} {:>7} {:>6} {:>6}",
            "", "ns/ray", "exact=1", "p50 ulp", "p99", "p99.9", "max", "missed", "extra", "other"
        );
        let exact = contenders.iter().position(|name| *name == "exact").expect("one is exact");
        let ratio =
            |times: &[f64], exact: &[f64]| median(times.iter().zip(exact).map(|(a, b)| a / b).collect());
        let ratios: Vec<f64> = times.iter().map(|one| ratio(one, &times[exact])).collect();
        let medians: Vec<f64> = times.into_iter().map(median).collect();
        let mut points = Vec::new();
        for (place, name) in contenders.iter().enumerate() {
            let errors = Errors::of(&truth, &hits[place]);
            println!(
                "  {name:<22} {:>8.1} {:>7.3} {:>9.3} {:>9.3} {:>9.3} {:>11.3} {:>7} {:>6} {:>6}",
                medians[place],
                ratios[place],
                errors.at(0.5),
                errors.at(0.99),
                errors.at(0.999),
                errors.at(1.0),
                errors.missed,
                errors.extra,
                errors.other
            );
            if !name.starts_with("engine") {
                points.push(Point {
                    name: (*name).to_owned(),
                    nanoseconds: medians[place],
                    p99: errors.at(0.99),
                    is_wrong: errors.wrong() > 0,
                });
            }
            if *name == "exact" || *name == "engine, exact" {
                assert!(errors.wrong() == 0 && errors.at(1.0) <= 0.5, "the exact mode is wrong: {errors:?}");
            }
        }
        panels.push(Panel { scene: scene.name.to_owned(), points });
    }
    if !chosen.is_empty() {
        return Ok(());
    }
    let (record, path) = match quick {
        true => (root.join("target/time-vs-error.tsv"), root.join("target/time-vs-error.svg")),
        false => (record, root.join("docs/time-vs-error.svg")),
    };
    plot::record(&record, &panels)?;
    plot::draw_recorded(&record, &path)?;
    println!("\n{}", path.display());
    Ok(())
}

/// The order of the contenders in a round: every number below `count` once, in a different order
/// each round.
fn order(round: usize, count: usize) -> impl Iterator<Item = usize> {
    let is_prime_to =
        |step: &usize| !(2..=*step).any(|factor| step.is_multiple_of(factor) && count.is_multiple_of(factor));
    let steps: Vec<usize> = (1..count.max(2)).filter(is_prime_to).collect();
    let step = steps[round % steps.len()];
    (0..count).map(move |turn| (round + turn * step) % count)
}

fn thread_time() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(now.tv_sec as u64, now.tv_nsec as u32)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

type Run<'a> = Box<dyn FnMut(&[Ray], &mut Vec<Hit>) + 'a>;

/// The contenders for a scene's kind of primitive.
fn contenders<'a>(scene: &'a Scene, trees: &'a SceneBvhs) -> Vec<(&'static str, Run<'a>)> {
    let mut out: Vec<(&'static str, Run<'a>)> = match scene.shapes[0] {
        Shape::Sphere(..) => vec![
            ("exact", runner::<Ours<block::Sphere4, EXACT>>(scene, trees)),
            ("double", runner::<Ours<block::Sphere4, DOUBLE>>(scene, trees)),
            ("float", runner::<Ours<block::Sphere4, FLOAT>>(scene, trees)),
            ("careful f32", runner::<RecentredSphere>(scene, trees)),
            ("naive f32", runner::<NaiveSphere>(scene, trees)),
        ],
        Shape::Swept(..) => vec![
            ("exact", runner::<Ours<block::LinearSweptSphere4, EXACT>>(scene, trees)),
            ("double", runner::<Ours<block::LinearSweptSphere4, DOUBLE>>(scene, trees)),
            ("float", runner::<Ours<block::LinearSweptSphere4, FLOAT>>(scene, trees)),
            ("careful f32", runner::<RoundCone<true>>(scene, trees)),
            ("naive f32", runner::<RoundCone<false>>(scene, trees)),
            ("capsule by distance", runner::<CapsuleByDistance>(scene, trees)),
        ],
        Shape::Triangle(_) => vec![
            ("exact", runner::<ExactTriangles>(scene, trees)),
            ("double", runner::<Ours<block::Triangle4, DOUBLE>>(scene, trees)),
            ("float", runner::<Ours<block::Triangle4, FLOAT>>(scene, trees)),
            ("naive f32", runner::<MoellerTrumbore>(scene, trees)),
            ("careful f32", runner::<Woop>(scene, trees)),
        ],
        Shape::Aabb(_) => vec![
            ("exact", runner::<Ours<block::Aabb4, EXACT>>(scene, trees)),
            ("double", runner::<Ours<block::Aabb4, DOUBLE>>(scene, trees)),
            ("float", runner::<Ours<block::Aabb4, FLOAT>>(scene, trees)),
            ("slabs f32", runner::<Slabs>(scene, trees)),
        ],
    };
    if !matches!(scene.shapes[0], Shape::Aabb(_)) && has_all_caps(scene) {
        out.push(("engine, exact", engine(scene, Precision::Exact)));
        out.push(("engine, double", engine(scene, Precision::Double)));
        out.push(("engine, float", engine(scene, Precision::Float)));
    }
    out
}

/// The contenders have both caps on every segment; a strand in the engine has not.
fn has_all_caps(scene: &Scene) -> bool {
    !matches!(scene.name, "chains" | "hair")
}

fn runner<'a, C: Contender + 'a>(scene: &'a Scene, trees: &'a SceneBvhs) -> Run<'a> {
    let field = ContenderScene::<C>::new(scene, trees);
    let cpu_tier = CpuTier::new();
    Box::new(move |rays, hits| cpu_tier.run(TracePass { field: &field, rays, hits }))
}

fn engine(scene: &Scene, precision: Precision) -> Run<'static> {
    let blas = Blas::new(vec![shape::opaque(scene.data.clone())]).expect("a valid BLAS");
    let instances = scene.matrices.iter().map(|matrix| TlasInstance::of(blas.clone(), *matrix));
    let tlas = Tlas::with_precision(instances.collect(), precision).expect("a valid TLAS");
    let trace = |ray| TraceRay { ray, flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 };
    let mut cursor = Cursor::new(&tlas, trace(scene.rays[0]));
    Box::new(move |rays, hits| {
        for ray in rays {
            cursor.reset(&tlas, trace(*ray));
            while cursor.proceed(&tlas).is_some() {}
            hits.push(cursor.committed().map(|hit| (hit.t, hit.candidate.instance, hit.candidate.primitive)));
        }
    })
}
