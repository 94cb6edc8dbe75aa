//! Recorded hits of a GPU driver with a high-precision reference beside them, against a linear scan
//! with our intersectors. `tests/driver-golden/README.md` says what the files hold.
//!
//! A thinned copy of the recordings lies in the repository; where the whole set is found beside the
//! checkout (`../shared/driver-golden`) it is read too.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhit::geometry::{
    Intersection, ObjectRay, Precision, Ray, Surface, Transform, linear_swept_sphere, sphere, triangle,
};
use anyhit::math::ulp::{ulp_error, ulp_of};
use rayon::prelude::*;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

mod flag {
    pub const OPAQUE: u32 = 1;
    pub const NO_OPAQUE: u32 = 2;
    pub const TERMINATE_ON_FIRST_HIT: u32 = 4;
    pub const CULL_BACK_FACING: u32 = 16;
    pub const CULL_FRONT_FACING: u32 = 32;
    pub const CULL_OPAQUE: u32 = 64;
    pub const CULL_NO_OPAQUE: u32 = 128;
    pub const SKIP_BUILTIN_PRIMITIVES: u32 = 256;
}

#[test]
fn spheres_agree_with_the_reference() {
    judge_files(
        |name| name.starts_with("sphere_") || name.starts_with("flags_sphere"),
        |file, recording| against_reference(file, recording, 1e-28, 0.0),
    );
}

#[test]
fn linear_swept_spheres_agree_with_the_reference() {
    judge_files(
        |name| name.starts_with("lss_") || name.starts_with("flags_lss"),
        |file, recording| against_reference(file, recording, 1e-28, 0.0),
    );
}

#[test]
fn triangles_agree_with_the_reference() {
    let is_triangle = |name: &str| name.starts_with("tri_") && !["tri_flags", "tri_mask"].contains(&name);
    judge_files(
        |name| is_triangle(name) && name != "tri_far_1e6",
        |file, recording| against_reference(file, recording, 1e-15, 1e-9),
    );
    // The 80-bit reference cancels the square of the distance, 10^12, in its barycentrics: against
    // rationals they are off by up to 2.2e-6 in this family (its t is not).
    judge_files(
        |name| name == "tri_far_1e6",
        |file, recording| against_reference(file, recording, 1e-15, 3e-6),
    );
}

/// From inside a closed mesh, aimed exactly at vertices and edges: one candidate a ray.
#[test]
fn a_closed_mesh_is_met_once_from_inside() {
    judge_files(
        |name| name == "tri_watertight_inside",
        |file, recording| {
            let t = file.floats("reference.t").unwrap();
            let mut tally = Tally { rays: recording.rays.len(), ..Tally::default() };
            let found: Vec<_> = recording.rays.par_iter().map(|ray| recording.trace(ray)).collect();
            for (i, found) in found.iter().enumerate() {
                if found.len() != 1 || ulp_error(found[0].hit.t, t[i]) > 0.5 {
                    tally.wrong.push(format!("ray {i}: reference t {}, {found:?}", t[i]));
                }
            }
            tally
        },
    );
}

/// Instance masks, facing, opacity and ray flags as the driver decided them.
#[test]
fn flags_and_masks_agree_with_the_driver() {
    judge_files(
        |name| ["tri_flags", "tri_mask"].contains(&name),
        |file, recording| {
            let t = file.floats("driver.t").unwrap();
            let kinds = file.integers("driver.hit_kind").unwrap();
            let missed = file.integers("driver.miss_ran").unwrap();
            let mut tally = Tally { rays: recording.rays.len(), ..Tally::default() };
            for (i, ray) in recording.rays.iter().enumerate() {
                let found = recording.trace(ray);
                if found.is_empty() != (missed[i] != 0) {
                    tally
                        .wrong
                        .push(format!("ray {i}: {found:?}, the driver's miss ran {} times", missed[i]));
                }
                // A hit is recorded only where the closest-hit shader ran, and is any one of them
                // where the first one ended the search.
                let Some(closest) = found.first().filter(|_| t[i] >= 0.0) else { continue };
                tally.hits += 1;
                let kind = if closest.front { 254 } else { 255 };
                if ray.flags & flag::TERMINATE_ON_FIRST_HIT == 0 && kinds[i] != kind {
                    tally.wrong.push(format!("ray {i}: hit kind {kind}, the driver's {}", kinds[i]));
                }
            }
            tally
        },
    );
}

/// What the comparison of one file came to.
#[derive(Default, Debug)]
struct Tally {
    rays: usize,
    hits: usize,
    undecidable: usize,
    ties: usize,
    max_ulp: f64,
    wrong: Vec<String>,
}

impl Tally {
    fn plus(mut self, other: Self) -> Self {
        self.rays += other.rays;
        self.hits += other.hits;
        self.undecidable += other.undecidable;
        self.ties += other.ties;
        self.max_ulp = self.max_ulp.max(other.max_ulp);
        self.wrong.extend(other.wrong);
        self
    }
}

/// Runs `judge` on every file whose name is `wanted`, and fails with all that was wrong.
fn judge_files(wanted: impl Fn(&str) -> bool, judge: impl Fn(&File<'_>, &Recording) -> Tally) {
    let mut wrong = Vec::new();
    let mut count = 0;
    for path in files().into_iter().filter(|path| wanted(stem(path))) {
        let bytes = std::fs::read(&path).unwrap();
        let file = File(SafeTensors::deserialize(&bytes).unwrap());
        let tally = judge(&file, &file.recording());
        let name = stem(&path);
        println!(
            "{name:28} rays {:5} hits {:5} undecidable {:3} ties {:4} max ulp {:.4} wrong {}",
            tally.rays,
            tally.hits,
            tally.undecidable,
            tally.ties,
            tally.max_ulp,
            tally.wrong.len()
        );
        count += 1;
        wrong.extend(tally.wrong.into_iter().take(5).map(|line| format!("{name}: {line}")));
    }
    assert!(count > 0, "no recordings found");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn files() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = Vec::new();
    for folder in [root.join("tests/driver-golden"), root.join("../shared/driver-golden")] {
        let Ok(entries) = std::fs::read_dir(folder) else { continue };
        let paths = entries.map(|entry| entry.unwrap().path());
        all.extend(paths.filter(|path| path.extension().is_some_and(|e| e == "safetensors")));
    }
    all.sort();
    all
}

fn stem(path: &Path) -> &str {
    path.file_stem().unwrap().to_str().unwrap()
}

/// Compares every ray with `reference.*`, but for those nearer to an edge than the reference sees.
/// `barycentric_error` is how far the reference's barycentrics may themselves be off.
fn against_reference(
    file: &File<'_>,
    recording: &Recording,
    least_margin: f64,
    barycentric_error: f64,
) -> Tally {
    let t = file.floats("reference.t").unwrap();
    let t_low = file.floats("reference.t_low");
    let margin = file.floats("reference.margin").or_else(|| file.floats("reference.edge_margin"));
    let [primitives, geometries, instances] = ["primitive_id", "geometry_index", "instance_id"]
        .map(|name| file.integers(&format!("reference.{name}")).unwrap());
    let hit_values = file.floats("reference.lss_hit_value");
    let barycentrics = file.floats("reference.barycentrics");

    let judge = |i: usize, ray: &TracedRay, tally: &mut Tally| -> Result<(), String> {
        let margin = margin.as_ref().map_or(1.0, |all| all[i]);
        // A margin of exactly 0 is a tangent to a sphere or cone, which is a hit. On a triangle's edge
        // the reference hits both neighbours and we one of them, or on an outline two or none.
        if margin < least_margin && (margin != 0.0 || barycentrics.is_some()) {
            tally.undecidable = 1;
            return Ok(());
        }
        let found = recording.trace(ray);
        let closest = match found.first() {
            None if t[i] < 0.0 => return Ok(()),
            None => return Err(format!("missed, reference t {}", t[i])),
            Some(closest) if t[i] < 0.0 => return Err(format!("extra {closest:?}")),
            Some(closest) => closest,
        };
        let low = t_low.as_ref().map_or(0.0, |all| all[i]);
        tally.hits = 1;
        tally.max_ulp = ((f64::from(closest.hit.t) - t[i]) - low).abs() / ulp_of(t[i]);
        if tally.max_ulp > 1.0 {
            return Err(format!("t {}, reference {}", closest.hit.t, t[i]));
        }
        let theirs = [instances[i], geometries[i], primitives[i]].map(|x| x as usize);
        tally.ties = usize::from([closest.instance, closest.geometry, closest.primitive] != theirs);
        // Another primitive at the same t is a tie and not an error.
        let same = found.iter().find(|f| [f.instance, f.geometry, f.primitive] == theirs);
        let Some(same) = same.filter(|same| same.hit.t == closest.hit.t) else {
            return Err(format!("{closest:?}, reference {theirs:?} at {}, which gives {same:?}", t[i]));
        };
        let [b1, b2] = same.hit.attributes;
        if let Some(all) = &hit_values {
            let (is_cap, should_be) = (b1 == 0.0 || b1 == 1.0, all[i] == 0.0 || all[i] == 1.0);
            if is_cap != should_be || ulp_error(b1, all[i]) > 1.0 {
                return Err(format!("u {b1}, reference {}", all[i]));
            }
        }
        if let Some(all) = &barycentrics {
            let expected = [all[2 * i], all[2 * i + 1]];
            let off = |ours: f32, theirs: f64| {
                ulp_error(ours, theirs) > 1.0 && (f64::from(ours) - theirs).abs() > barycentric_error
            };
            if off(b1, expected[0]) || off(b2, expected[1]) {
                return Err(format!("barycentrics {b1} {b2}, reference {expected:?}"));
            }
        }
        Ok(())
    };
    let tallies = recording.rays.par_iter().enumerate().map(|(i, ray)| {
        let mut tally = Tally { rays: 1, ..Tally::default() };
        if let Err(what) = judge(i, ray, &mut tally) {
            tally.wrong.push(format!("ray {i}: {what}"));
        }
        tally
    });
    tallies.reduce(Tally::default, Tally::plus)
}

struct Recording {
    geometries: Vec<Geometry>,
    instances: Vec<Instance>,
    rays: Vec<TracedRay>,
}

struct Geometry {
    shapes: Shapes,
    opaque: bool,
}

enum Shapes {
    LinearSweptSpheres(Vec<Segment>),
    Spheres(Vec<([f32; 3], f32)>),
    Triangles(Vec<[[f32; 3]; 3]>),
}

struct Segment {
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
}

struct Instance {
    transform: Option<Transform>,
    mask: u32,
    flags: u32,
}

struct TracedRay {
    ray: Ray,
    flags: u32,
    cull_mask: u32,
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Found {
    hit: Intersection,
    instance: usize,
    geometry: usize,
    primitive: usize,
    /// Whether a triangle faces the ray, instance flags considered.
    front: bool,
}

impl Recording {
    /// All candidates that survive culling, by (t, instance, geometry, primitive).
    fn trace(&self, ray: &TracedRay) -> Vec<Found> {
        let mut all = Vec::new();
        for (instance, it) in self.instances.iter().enumerate() {
            if it.mask & ray.cull_mask & 0xFF == 0 || ray.flags & flag::SKIP_BUILTIN_PRIMITIVES != 0 {
                continue;
            }
            let object_ray = match &it.transform {
                None => ObjectRay::in_world(&ray.ray),
                Some(transform) => ObjectRay::in_instance(&ray.ray, transform),
            };
            let object_ray = object_ray.expect("the recorded rays are finite");
            for (index, geometry) in self.geometries.iter().enumerate() {
                let mut opaque = (geometry.opaque || it.flags & 4 != 0) && it.flags & 8 == 0;
                opaque = (opaque || ray.flags & flag::OPAQUE != 0) && ray.flags & flag::NO_OPAQUE == 0;
                if ray.flags & if opaque { flag::CULL_OPAQUE } else { flag::CULL_NO_OPAQUE } != 0 {
                    continue;
                }
                geometry.shapes.intersect(&object_ray, |primitive, hit| {
                    let is_triangle = matches!(hit.surface, Surface::TriangleFront | Surface::TriangleBack);
                    let front = (hit.surface == Surface::TriangleFront) != (it.flags & 2 != 0);
                    let cull = if front { flag::CULL_FRONT_FACING } else { flag::CULL_BACK_FACING };
                    if !(is_triangle && it.flags & 1 == 0 && ray.flags & cull != 0) {
                        all.push(Found { hit, instance, geometry: index, primitive, front });
                    }
                });
            }
        }
        all.sort_by(|a, b| a.hit.t.total_cmp(&b.hit.t));
        all
    }
}

impl Shapes {
    fn intersect(&self, ray: &ObjectRay, mut report: impl FnMut(usize, Intersection)) {
        let mut keep = |primitive, hit: Option<Intersection>| {
            if let Some(hit) = hit {
                report(primitive, hit);
            }
        };
        match self {
            Self::LinearSweptSpheres(all) => {
                for (i, s) in all.iter().enumerate() {
                    let exact = Precision::Exact;
                    keep(i, linear_swept_sphere::intersect(ray, s.positions, s.radii, s.caps, exact));
                }
            }
            Self::Spheres(all) => {
                for (i, &(center, radius)) in all.iter().enumerate() {
                    keep(i, sphere::intersect(ray, center, radius, Precision::Exact));
                }
            }
            Self::Triangles(all) => {
                for (i, &vertices) in all.iter().enumerate() {
                    keep(i, triangle::intersect(ray, vertices, Precision::Exact));
                }
            }
        }
    }
}

/// A safetensors file's values as plain vectors.
struct File<'a>(SafeTensors<'a>);

impl File<'_> {
    fn has(&self, name: &str) -> bool {
        self.0.tensor(name).is_ok()
    }

    fn floats(&self, name: &str) -> Option<Vec<f64>> {
        let tensor = self.0.tensor(name).ok()?;
        let data = tensor.data();
        let single = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
        Some(match tensor.dtype() {
            Dtype::F32 => data.chunks_exact(4).map(|b| single(b).into()).collect(),
            Dtype::F64 => data.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect(),
            other => panic!("{name} is {other:?}"),
        })
    }

    fn rows<const N: usize>(&self, name: &str) -> Vec<[f32; N]> {
        let all = self.floats(name).unwrap_or_else(|| panic!("{name} is missing"));
        all.chunks_exact(N).map(|c| std::array::from_fn(|i| c[i] as f32)).collect()
    }

    fn integers(&self, name: &str) -> Option<Vec<i64>> {
        let tensor = self.0.tensor(name).ok()?;
        let word = |b: &[u8]| u32::from_le_bytes(b.try_into().unwrap());
        Some(match tensor.dtype() {
            Dtype::U32 => tensor.data().chunks_exact(4).map(|b| word(b).into()).collect(),
            Dtype::I32 => tensor.data().chunks_exact(4).map(|b| (word(b) as i32).into()).collect(),
            other => panic!("{name} is {other:?}"),
        })
    }

    fn recording(&self) -> Recording {
        let transforms = self.rows::<12>("instance.object_to_world");
        let masks = self.integers("instance.mask");
        let instance_flags = self.integers("instance.flags");
        let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let instances = transforms.iter().enumerate().map(|(i, m)| Instance {
            transform: (*m != identity).then(|| {
                let matrix = std::array::from_fn(|r| std::array::from_fn(|c| m[4 * r + c]));
                Transform::new(&matrix).expect("the recorded instances are invertible")
            }),
            mask: masks.as_ref().map_or(0xFF, |all| all[i] as u32),
            flags: instance_flags.as_ref().map_or(0, |all| all[i] as u32),
        });

        let (origins, directions) = (self.rows::<3>("ray.origin"), self.rows::<3>("ray.direction"));
        let (t_min, t_max) = (self.floats("ray.tmin"), self.floats("ray.tmax"));
        let (flags, cull_masks) = (self.integers("ray.flags"), self.integers("ray.cull_mask"));
        let rays = (0..origins.len()).map(|i| TracedRay {
            ray: Ray::new(origins[i], directions[i]).with_interval(
                t_min.as_ref().map_or(0.0, |all| all[i] as f32),
                t_max.as_ref().map_or(1e30, |all| all[i] as f32),
            ),
            flags: flags.as_ref().map_or(0, |all| all[i] as u32),
            cull_mask: cull_masks.as_ref().map_or(0xFF, |all| all[i] as u32),
        });
        Recording {
            geometries: (0..).map_while(|index| self.geometry(index)).collect(),
            instances: instances.collect(),
            rays: rays.collect(),
        }
    }

    fn geometry(&self, index: usize) -> Option<Geometry> {
        let name = |part: &str| format!("geometry{index}.{part}");
        let indices = self.integers(&name("indices"));
        let shapes = if self.has(&name("vertices")) {
            let vertices = self.rows::<3>(&name("vertices"));
            let corners: Vec<_> = indices.unwrap().iter().map(|&i| vertices[i as usize]).collect();
            Shapes::Triangles(corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
        } else if self.has(&name("radii")) {
            let positions = self.rows::<3>(&name("positions"));
            let radii = self.floats(&name("radii")).unwrap();
            match indices {
                None => Shapes::Spheres(positions.into_iter().zip(radii.iter().map(|&r| r as f32)).collect()),
                // SUCCESSIVE, CHAINED: a segment that follows in its chain has only its trailing cap.
                Some(indices) => {
                    let segment = |(i, &k): (usize, &i64)| {
                        let follows = i > 0 && k == indices[i - 1] + 1;
                        let k = k as usize;
                        Segment {
                            positions: [positions[k], positions[k + 1]],
                            radii: [radii[k] as f32, radii[k + 1] as f32],
                            caps: [!follows, true],
                        }
                    };
                    Shapes::LinearSweptSpheres(indices.iter().enumerate().map(segment).collect())
                }
            }
        } else {
            return None;
        };
        let opaque = self.integers(&name("opaque")).is_some_and(|all| all[0] != 0);
        Some(Geometry { shapes, opaque })
    }
}

/// Writes the thinned copy: every tensor of every recording, but of the rays only some, evenly spread.
#[test]
#[ignore = "rewrites tests/driver-golden from the whole set beside the checkout"]
fn thin_the_recordings() {
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/driver-golden");
    for path in files().into_iter().filter(|path| path.parent() != Some(&target)) {
        let bytes = std::fs::read(&path).unwrap();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        let rays = tensors.tensor("ray.origin").unwrap().shape()[0];
        // 641 shares no factor with the eight instances' and hundred flag sets' pattern of tri_flags.
        let kept = match stem(&path) {
            "tri_flags" => 641,
            _ if rays <= 200 => rays,
            _ => 64,
        };
        let thin = |name: &str, tensor: &TensorView<'_>| {
            let is_per_ray = ["ray.", "driver.", "reference."].iter().any(|prefix| name.starts_with(prefix));
            let mut shape = tensor.shape().to_vec();
            if !is_per_ray {
                return (tensor.dtype(), shape, tensor.data().to_vec());
            }
            let size = tensor.data().len() / shape[0];
            shape[0] = kept;
            let rows = (0..kept).flat_map(|i| &tensor.data()[i * rays / kept * size..][..size]);
            (tensor.dtype(), shape, rows.copied().collect())
        };
        let thinned: BTreeMap<_, _> =
            tensors.iter().map(|(name, tensor)| (name.to_owned(), thin(name, &tensor))).collect();
        let views = thinned.iter().map(|(name, (dtype, shape, data))| {
            (name, TensorView::new(*dtype, shape.clone(), data).unwrap())
        });
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let mut notes = header.metadata().clone().unwrap_or_default();
        notes.insert("thinned".into(), format!("{kept} of {rays} rays"));
        safetensors::serialize_to_file(views, Some(notes), &target.join(path.file_name().unwrap())).unwrap();
    }
}
