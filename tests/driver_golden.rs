//! Recorded hits of a GPU driver with a high-precision reference beside them, against our traversal.
//! `tests/driver-golden/README.md` says what the files hold.
//!
//! A thinned copy of the recordings lies in the repository; where the whole set is found beside the
//! checkout (`../shared/driver-golden`) it is read too.

#![allow(clippy::print_stdout, reason = "the figures are worth reading: cargo test -- --nocapture")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhit::accel::{
    Blas, Candidate, Committed, Cursor, EndCaps, Geometry, GeometryData, GeometryFlags, HitKind, Indexing,
    Instance, InstanceFlags, Place, PrimitiveVerdict, RayFlags, Tlas, TraceRay, Visit,
};
use anyhit::geometry::{Intersection, Ray};
use anyhit::math::ulp::{ulp_error, ulp_of};
use rayon::prelude::*;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

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
            let found: Vec<_> = recording.rays.par_iter().map(|ray| recording.candidates(*ray)).collect();
            for (i, found) in found.iter().enumerate() {
                if found.len() != 1 || ulp_error(found[0].intersection.t, t[i]) > 0.5 {
                    tally.wrong.push(format!("ray {i}: reference t {}, {found:?}", t[i]));
                }
            }
            tally
        },
    );
}

/// Instance masks, facing, opacity and ray flags as the driver decided them: which shaders ran, how
/// often any-hit did, and the hit kind.
#[test]
fn flags_and_masks_agree_with_the_driver() {
    judge_files(
        |name| ["tri_flags", "tri_mask"].contains(&name),
        |file, recording| {
            let [kinds, misses, closest_hits, any_hits] =
                ["hit_kind", "miss_ran", "closest_hit_ran", "any_hit_count"]
                    .map(|name| file.integers(&format!("driver.{name}")).unwrap());
            let mut tally = Tally { rays: recording.rays.len(), ..Tally::default() };
            for (i, ray) in recording.rays.iter().enumerate() {
                let traced = recording.trace(*ray);
                let skips = ray.flags.contains(RayFlags::SKIP_CLOSEST_HIT_SHADER);
                let hit = traced.committed;
                tally.hits += usize::from(hit.is_some());
                let ours = (i64::from(hit.is_none()), i64::from(hit.is_some() && !skips), traced.any_hits);
                let theirs = (misses[i], closest_hits[i], any_hits[i]);
                if ours != theirs {
                    tally
                        .wrong
                        .push(format!("ray {i} {ray:?}: miss, closest-hit, any-hit {ours:?}, {theirs:?}"));
                }
                // The kind is recorded by the closest-hit shader only.
                let kind = hit.filter(|_| !skips).map(|hit| i64::from(hit.hit_kind.0));
                if kind.is_some_and(|kind| kind != kinds[i]) {
                    tally
                        .wrong
                        .push(format!("ray {i} {ray:?}: hit kind {kind:?}, the driver's {}", kinds[i]));
                }
            }
            tally
        },
    );
}

/// Boxes whose intersection shader looks for a sphere: far root first, then the near one.
#[test]
fn boxes_agree_with_the_driver() {
    judge_files(
        |name| name.starts_with("aabb_"),
        |file, recording| {
            let [kinds, misses, primitives] = ["hit_kind", "miss_ran", "primitive_id"]
                .map(|name| file.integers(&format!("driver.{name}")).unwrap());
            let t = file.floats("driver.t").unwrap();
            let mut tally = Tally { rays: recording.rays.len(), ..Tally::default() };
            for (i, ray) in recording.rays.iter().enumerate() {
                let traced = recording.trace(*ray);
                if traced.nearly_tangent {
                    tally.undecidable += 1;
                    continue;
                }
                let hit = traced.committed;
                tally.hits += usize::from(hit.is_some());
                let ours = hit.map(|hit| (hit.candidate.primitive.into(), i64::from(hit.hit_kind.0)));
                let theirs = (misses[i] == 0).then_some((primitives[i], kinds[i]));
                if ours != theirs {
                    tally
                        .wrong
                        .push(format!("ray {i} {ray:?}: {ours:?}, the driver's {theirs:?} at {}", t[i]));
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

    let judge = |i: usize, ray: &TraceRay, tally: &mut Tally| -> Result<(), String> {
        let margin = margin.as_ref().map_or(1.0, |all| all[i]);
        // A margin of exactly 0 is a tangent to a sphere or cone, which is a hit. On a triangle's edge
        // the reference hits both neighbours and we one of them, or on an outline two or none.
        if margin < least_margin && (margin != 0.0 || barycentrics.is_some()) {
            tally.undecidable = 1;
            return Ok(());
        }
        let traced = recording.trace(*ray);
        let closest = match traced.committed {
            None if t[i] < 0.0 => return Ok(()),
            None => return Err(format!("missed, reference t {}", t[i])),
            Some(closest) if t[i] < 0.0 => return Err(format!("extra {closest:?}")),
            Some(closest) => closest,
        };
        let low = t_low.as_ref().map_or(0.0, |all| all[i]);
        tally.hits = 1;
        tally.max_ulp = ((f64::from(closest.t) - t[i]) - low).abs() / ulp_of(t[i]);
        if tally.max_ulp > 1.0 {
            return Err(format!("t {}, reference {}", closest.t, t[i]));
        }
        let [instance, geometry, primitive] = [instances[i], geometries[i], primitives[i]].map(|x| x as u32);
        let theirs = Place { instance, geometry, primitive };
        tally.ties = usize::from(closest.candidate.place() != theirs);
        // Another primitive at the same t is a tie and not an error.
        let same = traced.met.iter().find(|(place, _)| *place == theirs).map(|(_, found)| found);
        let Some(same) = same.filter(|same| same.t == closest.t) else {
            return Err(format!("{closest:?}, reference {theirs:?} at {}, which gives {same:?}", t[i]));
        };
        let [b1, b2] = same.attributes;
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
    tlas: Arc<Tlas>,
    rays: Vec<TraceRay>,
    /// The sphere in each box, as centre and radius.
    spheres: Vec<[f32; 4]>,
}

/// What a trace came to whose any-hit shader accepts all.
struct Traced {
    committed: Option<Committed>,
    any_hits: i64,
    /// Every primitive that was met, also behind the closest.
    met: Vec<(Place, Intersection)>,
    /// The intersection shader's arithmetic decides.
    nearly_tangent: bool,
}

impl Recording {
    /// Traces with an any-hit shader that counts and accepts.
    fn trace(&self, ray: TraceRay) -> Traced {
        let mut met = Met::default();
        let mut cursor = Cursor::new(&self.tlas, ray);
        let (mut any_hits, mut nearly_tangent) = (0, false);
        while let Some(candidate) = cursor.proceed_with(&self.tlas, &mut met) {
            if candidate.is_box() {
                nearly_tangent |= self.intersection_shader(&mut cursor, &candidate, &mut any_hits);
            } else {
                any_hits += 1;
                cursor.confirm();
            }
        }
        Traced { committed: cursor.committed().copied(), any_hits, met: met.0, nearly_tangent }
    }

    /// Reports the far root of the box's sphere with kind 2, then the near one with kind 1. Says
    /// whether f32 arithmetic, as in the recorded shader, could see another number of roots.
    fn intersection_shader(&self, cursor: &mut Cursor, candidate: &Candidate, any_hits: &mut i64) -> bool {
        let ray = self.tlas.object_ray(candidate.instance, &cursor.trace().ray).expect("a finite ray");
        let [x, y, z, radius] = self.spheres[candidate.primitive as usize].map(f64::from);
        let o = ray.object_origin_f32().map(f64::from);
        let d = ray.object_direction_f32().map(f64::from);
        let m = [o[0] - x, o[1] - y, o[2] - z];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (a, b, c) = (dot(d, d), dot(m, d), dot(m, m) - radius * radius);
        let discriminant = b * b - a * c;
        let nearly_tangent = discriminant.abs() < 1e-5 * b * b;
        if discriminant >= 0.0 {
            for (sign, kind) in [(1.0, 2), (-1.0, 1)] {
                let t = ((-b + sign * discriminant.sqrt()) / a) as f32;
                if cursor.accepts(t) {
                    *any_hits += i64::from(!candidate.opaque);
                    cursor.generate(t, HitKind(kind));
                }
            }
        }
        nearly_tangent
    }

    /// All candidates in order, where every geometry is non-opaque and none is accepted.
    fn candidates(&self, ray: TraceRay) -> Vec<Candidate> {
        let mut cursor = Cursor::new(&self.tlas, TraceRay { flags: RayFlags::NO_OPAQUE, ..ray });
        std::iter::from_fn(|| cursor.proceed(&self.tlas)).collect()
    }
}

/// Notes every primitive that is met and not culled.
#[derive(Default)]
struct Met(Vec<(Place, Intersection)>);

impl Visit for Met {
    const REASONS: bool = false;

    fn primitive(&mut self, place: Place, verdict: PrimitiveVerdict) {
        use PrimitiveVerdict as V;
        if let V::Behind(found) | V::Opaque(found) | V::Candidate(found) = verdict {
            self.0.push((place, found));
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
        let geometries = (0..).map_while(|index| self.geometry(index)).collect();
        let blas = Blas::new(geometries).unwrap();
        let masks = self.integers("instance.mask");
        let flags = self.integers("instance.flags");
        let transforms = self.rows::<12>("instance.object_to_world");
        let instances = transforms.iter().enumerate().map(|(i, m)| Instance {
            blas: blas.clone(),
            transform: std::array::from_fn(|r| std::array::from_fn(|c| m[4 * r + c])),
            custom_index: 100 + i as u32,
            mask: masks.as_ref().map_or(0xFF, |all| all[i] as u8),
            sbt_record_offset: 0,
            flags: InstanceFlags(flags.as_ref().map_or(0, |all| all[i] as u32)),
        });

        let (origins, directions) = (self.rows::<3>("ray.origin"), self.rows::<3>("ray.direction"));
        let (t_min, t_max) = (self.floats("ray.tmin"), self.floats("ray.tmax"));
        let (flags, cull_masks) = (self.integers("ray.flags"), self.integers("ray.cull_mask"));
        let rays = (0..origins.len()).map(|i| TraceRay {
            ray: Ray::new(origins[i], directions[i]).with_interval(
                t_min.as_ref().map_or(0.0, |all| all[i] as f32),
                t_max.as_ref().map_or(1e30, |all| all[i] as f32),
            ),
            flags: RayFlags(flags.as_ref().map_or(0, |all| all[i] as u32)),
            cull_mask: cull_masks.as_ref().map_or(0xFF, |all| all[i] as u32),
        });
        Recording {
            tlas: Tlas::new(instances.collect()).unwrap(),
            rays: rays.collect(),
            spheres: if self.has("procedural.sphere") { self.rows("procedural.sphere") } else { Vec::new() },
        }
    }

    fn geometry(&self, index: usize) -> Option<Geometry> {
        let name = |part: &str| format!("geometry{index}.{part}");
        let indices =
            self.integers(&name("indices")).map(|all| all.into_iter().map(|i| i as u32).collect::<Vec<_>>());
        let data = if self.has(&name("vertices")) {
            GeometryData::Triangles { vertices: self.rows(&name("vertices")), indices, transform: None }
        } else if self.has(&name("aabb")) {
            GeometryData::Aabbs(self.rows(&name("aabb")))
        } else if self.has(&name("radii")) {
            let positions = self.rows(&name("positions"));
            let radii = self.floats(&name("radii")).unwrap().into_iter().map(|r| r as f32).collect();
            match indices {
                None => GeometryData::Spheres { positions, radii, indices },
                Some(_) => GeometryData::LinearSweptSpheres {
                    positions,
                    radii,
                    indices,
                    indexing: Indexing::Successive,
                    end_caps: EndCaps::Chained,
                },
            }
        } else {
            return None;
        };
        let opaque = self.integers(&name("opaque")).is_some_and(|all| all[0] != 0);
        Some(Geometry { data, flags: if opaque { GeometryFlags::OPAQUE } else { GeometryFlags::default() } })
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
