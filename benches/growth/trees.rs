//! Acceleration structures by the number of primitives and instances: building, and rays.

use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use anyhit_engine::accel::{
    Blas, Cursor, EndCaps, Geometry, GeometryData, GeometryFlags, Indexing, RayFlags, Tlas, TlasInstance,
    TraceRay,
};

use crate::curve::Curve;
use crate::fit::Growth;
use crate::measure::Work;
use crate::scenes::{self, Random};

const SIZES: [usize; 4] = [1 << 11, 1 << 13, 1 << 15, 1 << 17];
const PICTURE: [u32; 2] = [96, 64];

/// Makes a geometry of about so many primitives.
type MakeGeometry = fn(usize) -> GeometryData;

/// The curves of acceleration structures.
pub fn curves() -> Vec<Curve> {
    let geometries: [(&str, &str, MakeGeometry); 4] = [
        ("build: triangles", "rays: triangles", triangles),
        ("build: spheres", "rays: spheres", spheres),
        ("build: swept spheres", "rays: swept spheres", swept_spheres),
        ("build: boxes", "rays: boxes", boxes),
    ];
    let mut curves = Vec::new();
    for (build, rays, make) in geometries {
        curves.push(Curve::linear(build, SIZES, move |_: &Path, n| {
            let data = make(n);
            Work::call(move || {
                let _ = black_box(built(one(&blas_of(data.clone()))));
            })
        }));
        curves.push(traced(rays, SIZES, move |n| one(&blas_of(make(n)))));
    }
    // Instances of a BLAS that is built.
    let sizes = [1 << 10, 1 << 12, 1 << 14, 1 << 16];
    curves.push(Curve::linear("build: instances", sizes, |_: &Path, n| {
        let blas = blas_of(triangles(128));
        let _ = built(one(&blas));
        Work::call(move || {
            let _ = black_box(built(placed(&blas, n)));
        })
    }));
    curves.push(traced("rays: instances", sizes, |n| placed(&blas_of(triangles(128)), n)));
    curves
}

/// The rays of a picture, one by one, through a structure that is built.
fn traced(name: &'static str, sizes: [usize; 4], make: impl Fn(usize) -> Arc<Tlas> + 'static) -> Curve {
    let curve = Curve::linear(name, sizes, move |_: &Path, n| {
        let tlas = built(make(n));
        let rays = rays(PICTURE);
        Work::call(move || {
            black_box(hits(&tlas, &rays));
        })
    });
    curve.time(Growth::Logarithmic).memory(Growth::Constant)
}

fn rays(picture: [u32; 2]) -> Vec<TraceRay> {
    let rays = scenes::heightfield(1).camera.rays(picture);
    let trace = |ray| TraceRay { ray, flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 };
    rays.into_iter().map(trace).collect()
}

/// The number of rays that hit; boxes have no hits, only candidates.
fn hits(tlas: &Tlas, rays: &[TraceRay]) -> usize {
    let mut cursor = Cursor::new(tlas, rays[0]);
    let hits = rays.iter().filter(|ray| {
        cursor.reset(tlas, **ray);
        let mut any = false;
        while cursor.proceed(tlas).is_some() {
            any = true;
        }
        any || cursor.committed().is_some()
    });
    hits.count()
}

/// The structure with all its trees, which the first rays build.
fn built(tlas: Arc<Tlas>) -> Arc<Tlas> {
    assert!(hits(&tlas, &rays([16, 16])) > 0, "no ray hits");
    assert!(tlas.instances()[0].blas.has_bvh() || tlas.instances().len() > 1, "no tree");
    tlas
}

fn blas_of(data: GeometryData) -> Arc<Blas> {
    Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)]).expect("a valid geometry")
}

fn one(blas: &Arc<Blas>) -> Arc<Tlas> {
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    Tlas::new(vec![TlasInstance::of(blas.clone(), identity)]).expect("a valid instance")
}

/// `n` places side by side, together as wide as one.
fn placed(blas: &Arc<Blas>, n: usize) -> Arc<Tlas> {
    let side = (n as f32).sqrt() as usize;
    let instances = (0..side * side).map(|number| {
        let at = |k: usize| -5.0 + 10.0 * (k as f32 + 0.5) / side as f32;
        let (x, z, s) = (at(number % side), at(number / side), 1.0 / side as f32);
        TlasInstance::of(blas.clone(), [[s, 0.0, 0.0, x], [0.0, s, 0.0, 0.0], [0.0, 0.0, s, z]])
    });
    Tlas::new(instances.collect()).expect("valid instances")
}

fn triangles(n: usize) -> GeometryData {
    scenes::heightfield(((n / 2) as f32).sqrt() as u32).data
}

/// `n` spheres in a slab, of such a radius that a ray passes about as many whatever n is.
fn balls(n: usize) -> Vec<[f32; 4]> {
    let mut random = Random(11);
    let radius = 3.0 / (n as f64).sqrt();
    let ranges = [(-5.0, 5.0), (0.0, 1.5), (-5.0, 5.0), (0.5 * radius, radius)];
    (0..n).map(|_| ranges.map(|(low, high)| random.between(low, high) as f32)).collect()
}

fn spheres(n: usize) -> GeometryData {
    let balls = balls(n);
    GeometryData::Spheres {
        positions: balls.iter().map(|&[x, y, z, _]| [x, y, z]).collect(),
        radii: balls.iter().map(|ball| ball[3]).collect(),
        indices: None,
    }
}

fn swept_spheres(n: usize) -> GeometryData {
    let ends =
        || balls(n).into_iter().flat_map(|[x, y, z, r]| [[x, y, z, r], [x + 2.0 * r, y + r, z, 0.5 * r]]);
    GeometryData::LinearSweptSpheres {
        positions: ends().map(|[x, y, z, _]| [x, y, z]).collect(),
        radii: ends().map(|end| end[3]).collect(),
        indices: None,
        indexing: Indexing::List,
        end_caps: EndCaps::Chained,
    }
}

fn boxes(n: usize) -> GeometryData {
    let around = |[x, y, z, r]: [f32; 4]| [x - r, y - r, z - r, x + r, y + r, z + r];
    GeometryData::Aabbs(balls(n).into_iter().map(around).collect())
}
