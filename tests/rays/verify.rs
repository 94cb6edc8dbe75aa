//! `anyhit verify` on recordings made here, and on damaged ones.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhit_base::error::ErrorKind;
use anyhit_cases::recording::Recording;
use pretty_assertions::assert_eq;
use safetensors::Dtype;
use safetensors::tensor::TensorView;
use serde_json::Value;

/// Tensors by name: type, shape, bytes.
#[derive(Clone, Default)]
struct Draft {
    tensors: BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>,
    notes: Vec<(String, String)>,
}

impl Draft {
    fn raw(mut self, name: &str, dtype: Dtype, shape: &[usize], bytes: Vec<u8>) -> Self {
        self.tensors.insert(name.into(), (dtype, shape.to_vec(), bytes));
        self
    }

    fn f32(self, name: &str, shape: &[usize], values: &[f32]) -> Self {
        self.raw(name, Dtype::F32, shape, values.iter().flat_map(|x| x.to_le_bytes()).collect())
    }

    fn f64(self, name: &str, values: &[f64]) -> Self {
        let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.raw(name, Dtype::F64, &[values.len()], bytes)
    }

    fn f16(self, name: &str, shape: &[usize], values: &[f32]) -> Self {
        let bytes = values.iter().flat_map(|x| half::f16::from_f32(*x).to_le_bytes()).collect();
        self.raw(name, Dtype::F16, shape, bytes)
    }

    fn i32(self, name: &str, shape: &[usize], values: &[i32]) -> Self {
        self.raw(name, Dtype::I32, shape, values.iter().flat_map(|x| x.to_le_bytes()).collect())
    }

    fn without(mut self, name: &str) -> Self {
        self.tensors.remove(name).expect("a tensor of the draft");
        self
    }

    fn note(mut self, key: &str, value: &str) -> Self {
        self.notes.push((key.into(), value.into()));
        self
    }

    fn bytes(&self) -> Vec<u8> {
        let views = self.tensors.iter().map(|(name, (dtype, shape, data))| {
            (name, TensorView::new(*dtype, shape.clone(), data).unwrap())
        });
        safetensors::serialize(views, Some(self.notes.iter().cloned().collect())).unwrap()
    }

    fn file(&self, name: &str) -> PathBuf {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(&path, self.bytes()).expect("a writable folder");
        path
    }

    /// What is wrong with it.
    fn mistake(&self) -> String {
        let error = Recording::of(&self.bytes()).expect_err("a mistake");
        assert_eq!(error.kind(), ErrorKind::InvalidRecording);
        error.render()
    }
}

/// Two rays down at z = 0: one meets the triangle at t = 3, the other nothing.
fn triangle() -> Draft {
    Draft::default()
        .f32("ray.origin", &[2, 3], &[0.0, 0.0, 3.0, 5.0, 5.0, 3.0])
        .f32("ray.direction", &[2, 3], &[0.0, 0.0, -1.0, 0.0, 0.0, -1.0])
        .f32("geometry0.vertices", &[3, 3], &[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 2.0, 0.0])
        .f32("driver.t", &[2], &[3.0, -1.0])
}

/// A ray at a sphere of radius 1/2 around (1, 0, 0), and one at its other half.
fn spheres() -> Draft {
    Draft::default()
        .f32("ray.origin", &[1, 3], &[1.0, 0.0, 4.0])
        .f32("ray.direction", &[1, 3], &[0.0, 0.0, -1.0])
        .f32("geometry0.positions", &[2, 3], &[9.0, 9.0, 9.0, 1.0, 0.0, 0.0])
        .f32("geometry0.radii", &[2], &[0.5, 0.5])
        .f32("driver.t", &[1], &[3.5])
}

fn verify(arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    let output = command.arg("verify").args(arguments).stdin(Stdio::null()).output().expect("it starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn what_is_absent_has_its_default() {
    let found = Recording::of(&triangle().bytes()).unwrap().compare();
    let driver = found.driver.unwrap();
    assert_eq!((driver.hits.rows, driver.hits.hits), (2, 1));
    assert_eq!((driver.hits.missed, driver.hits.extra, driver.hits.other_primitive), (0, 0, 0));
    assert_eq!(driver.hits.t_ulp.unwrap().max, 0.0);
    assert!(found.reference.is_none() && driver.shaders_ran.is_none() && driver.attributes.is_none());
}

#[test]
fn rows_are_missed_extra_of_another_primitive_or_ties() {
    // The first sphere is not where the ray goes; the second is.
    let one = |t: f32, primitive: i32| {
        let draft = spheres().f32("driver.t", &[1], &[t]).i32("driver.primitive_id", &[1], &[primitive]);
        Recording::of(&draft.bytes()).unwrap().compare().driver.unwrap().hits
    };
    let right = one(3.5, 1);
    assert_eq!((right.hits, right.ties, right.other_primitive, right.missed, right.extra), (1, 0, 0, 0, 0));
    assert_eq!(one(-1.0, -1).extra, 1);
    // Recorded at another t: another primitive. At ours: a tie.
    assert_eq!((one(3.0, 0).other_primitive, one(3.0, 0).ties), (1, 0));
    assert_eq!((one(3.5, 0).other_primitive, one(3.5, 0).ties), (0, 1));
    // 3.5 + 2^-22, the next float.
    assert_eq!(one(3.5f32.next_up(), 1).t_ulp.unwrap().max, 1.0);
    let far = spheres().f32("ray.tmax", &[1], &[1.0]);
    let hits = Recording::of(&far.bytes()).unwrap().compare().driver.unwrap().hits;
    assert_eq!((hits.missed, hits.examples.len()), (1, 1));
    assert!(hits.examples[0].starts_with("ray 0: missed: recorded "), "{:?}", hits.examples);
}

#[test]
fn a_reference_leaves_out_what_it_cannot_decide() {
    let with = |margin: f64| {
        let draft = spheres().f64("reference.t", &[-1.0]).f64("reference.margin", &[margin]);
        Recording::of(&draft.bytes()).unwrap().compare().reference.unwrap().hits
    };
    assert_eq!((with(1e-30).undecidable, with(1e-30).extra), (1, 0));
    // An exact 0 is a tangent, which is decided.
    assert_eq!((with(0.0).undecidable, with(0.0).extra), (0, 1));
    assert_eq!((with(0.5).undecidable, with(0.5).extra), (0, 1));
}

/// Vertices of 16 bits, of two components, normalised; indices of 16 bits; index modes; a
/// transform.
#[test]
fn formats_modes_and_transforms_are_read() {
    let t = |draft: &Draft| {
        let recording = Recording::of(&draft.bytes()).unwrap();
        recording.trace(recording.rays[0]).committed.map(|hit| (hit.candidate.primitive, hit.t))
    };
    let positions = [9.0, 9.0, 9.0, 1.0, 0.0, 0.0];
    assert_eq!(t(&spheres().f16("geometry0.positions", &[2, 3], &positions)), Some((1, 3.5)));
    let halves = spheres().f16("geometry0.radii", &[2], &[0.25, 0.25]);
    assert_eq!(t(&halves), Some((1, 3.75)));
    assert_eq!(t(&spheres().f32("geometry0.positions", &[2, 2], &[9.0, 9.0, 1.0, 0.0])), Some((1, 3.5)));
    let four = [9.0, 9.0, 9.0, 7.0, 1.0, 0.0, 0.0, 7.0];
    assert_eq!(t(&spheres().f16("geometry0.positions", &[2, 4], &four)), Some((1, 3.5)));
    // 32767 is 1, -32768 is -1 as well as -32767.
    let words = [-32768i16, 0, 0, 32767, 0, 0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let normalised = spheres().raw("geometry0.positions", Dtype::I16, &[2, 3], words);
    assert_eq!(t(&normalised), Some((1, 3.5)));
    let moved = spheres().f32(
        "instance.object_to_world",
        &[1, 3, 4],
        &[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 1.],
    );
    assert_eq!(t(&moved), Some((1, 2.5)));
    // The one sphere twice, by indices, where the metadata say so; otherwise indices make a chain.
    let indexed =
        spheres().raw("geometry0.indices", Dtype::U16, &[2], vec![0, 0, 1, 0]).note("kind", "sphere");
    assert_eq!(t(&indexed), Some((1, 3.5)));
    let segment = Draft::default()
        .f32("ray.origin", &[1, 3], &[1.0, 0.0, 4.0])
        .f32("ray.direction", &[1, 3], &[0.0, 0.0, -1.0])
        .f32("geometry0.positions", &[4, 3], &[7., 7., 7., 0., 0., 0., 2., 0., 0., 4., 0., 0.])
        .f32("geometry0.radii", &[4], &[0.5; 4])
        .f32("driver.t", &[1], &[3.5]);
    assert_eq!(t(&segment.clone().i32("geometry0.indices", &[2], &[2, 1])), Some((1, 3.5)));
    let list = segment.clone().i32("geometry0.indexing_mode", &[1], &[0]);
    assert_eq!(t(&list.clone().i32("geometry0.indices", &[2, 2], &[2, 3, 1, 2])), Some((1, 3.5)));
    // Without caps the ray at the end of the axis, within the radius, meets nothing.
    let end = segment.f32("ray.origin", &[1, 3], &[-0.25, 0.0, 4.0]).i32("geometry0.indices", &[1], &[1]);
    assert!(t(&end).is_some());
    assert_eq!(t(&end.i32("geometry0.end_caps", &[1], &[0])), None);
    let mirrored =
        triangle().f32("geometry0.transform", &[3, 4], &[-1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0.5]);
    assert_eq!(t(&mirrored), Some((0, 2.5)));
}

#[test]
fn a_mistake_names_its_tensor() {
    let one = |draft: &Draft, wanted: &str| {
        let found = draft.mistake();
        assert!(found.contains(wanted), "no `{wanted}` in:\n{found}");
    };
    one(&triangle().without("ray.origin"), "the tensor `ray.origin` is missing");
    one(&triangle().without("ray.direction"), "the tensor `ray.direction` is missing");
    one(&triangle().without("geometry0.vertices"), "the tensor `geometry0.vertices` is missing");
    one(&triangle().without("driver.t"), "neither `driver.t` nor `reference.t`");
    one(&spheres().without("geometry0.radii"), "the tensor `geometry0.radii` is missing");
    one(&spheres().without("geometry0.positions"), "the tensor `geometry0.positions` is missing");
    one(
        &triangle().f32("ray.direction", &[1, 3], &[0.0; 3]),
        "`ray.direction` is 1 x 3 of F32: expected 2 rows",
    );
    one(&triangle().f32("ray.origin", &[6], &[0.0; 6]), "`ray.origin` is 6 of F32: expected rows of 3");
    one(
        &triangle().f64("ray.tmin", &[0.5, 0.1]),
        "`ray.tmin` is 2 of F64: number 1 is 0.1, which is not an F32",
    );
    one(&triangle().i32("driver.t", &[2], &[1, 2]), "`driver.t` is 2 of I32: expected F32 or F64");
    one(&triangle().f32("ray.flags", &[2], &[0.0; 2]), "`ray.flags` is 2 of F32: expected integers");
    one(&triangle().i32("ray.flags", &[2], &[0, -1]), "number 1 is -1");
    one(&triangle().i32("instance.mask", &[1], &[256]), "`instance.mask` is 1 of I32: number 0 is 256");
    one(&triangle().f32("instance.object_to_world", &[1, 4, 3], &[0.0; 12]), "expected I x 3 x 4");
    one(&triangle().f32("instance.object_to_world", &[1, 3, 4], &[0.0; 12]), "the transform is singular");
    one(&triangle().f32("geometry0.vertices", &[3, 5], &[0.0; 15]), "`geometry0.vertices` is 3 x 5");
    one(&triangle().i32("geometry0.indices", &[1, 3], &[0, 1, 3]), "indices[2] names vertex 3 of 3");
    one(&spheres().f32("geometry0.radii", &[3], &[1.0; 3]), "2 positions with 3 radii");
    one(&spheres().i32("geometry0.end_caps", &[1], &[7]), "`geometry0.end_caps` is 7");
    one(&spheres().f32("driver.position_radius", &[1, 3], &[0.0; 3]), "`driver.position_radius` is 1 x 3");
    let boxes =
        triangle().without("geometry0.vertices").f32("geometry0.aabb", &[1, 6], &[0., 0., 0., 1., 1., 1.]);
    one(&boxes, "the tensor `procedural.sphere` is missing");
    one(&boxes.f32("procedural.sphere", &[2, 4], &[0.0; 8]), "`procedural.sphere` has 2 rows for 1 boxes");
    let apart = triangle().f32("geometry2.vertices", &[3, 3], &[0.0; 9]);
    one(&apart, "tensor `geometry2.vertices` is present, but geometry 1 is missing");
    let bytes = triangle().bytes();
    for cut in [0, 7, 40, bytes.len() - 1] {
        let error = Recording::of(&bytes[..cut]).expect_err("a mistake");
        assert!(error.message().starts_with("not a safetensors file: "), "{error}");
    }
}

#[test]
fn what_others_write_is_understood() {
    let agrees = |draft: &Draft| {
        let found = Recording::of(&draft.bytes()).expect("a recording").compare();
        let hits = found.driver.expect("a driver").hits;
        assert_eq!((hits.missed, hits.extra, hits.other_primitive), (0, 0, 0), "{:?}", hits.examples);
        assert!(hits.hits > 0 && hits.t_ulp.is_some_and(|ulp| ulp.max == 0.0));
        found.notes
    };
    // Doubles that are floats; one number for all rays; one for all radii; a single matrix.
    agrees(&triangle().f64("ray.tmin", &[0.5, 0.25]));
    agrees(&triangle().i32("ray.flags", &[1], &[1]).f32("ray.tmax", &[1], &[9.0]));
    agrees(&triangle().f32(
        "instance.object_to_world",
        &[3, 4],
        &[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0.],
    ));
    agrees(&spheres().f32("geometry0.radii", &[1], &[0.5]));
    // Spheres with indices, told by the driver's own shaders.
    let indexed = || spheres().i32("geometry0.indices", &[2], &[1, 0]).i32("driver.primitive_id", &[1], &[0]);
    agrees(&indexed().i32("driver.is_sphere", &[1], &[1]));
    agrees(&indexed().f32("driver.position_radius", &[1, 4], &[1.0, 0.0, 0.0, 0.5]));
    // A miss by infinity.
    agrees(&triangle().f32("driver.t", &[2], &[3.0, f32::INFINITY]));
    // A negative radius is not valid
    // (VUID-VkAccelerationStructureGeometrySpheresDataNV-radiusData-10436).
    let notes = agrees(&spheres().f32("geometry0.radii", &[2], &[-1.0, 0.5]));
    assert!(notes[0].contains("1 radii of `geometry0.radii` are negative"), "{notes:?}");
}

#[test]
fn limits_decide_the_exit_code() {
    let good = triangle().file("verify-good.safetensors");
    // One hit that is not there, one that is there and was not recorded.
    let bad = triangle().f32("driver.t", &[2], &[-1.0, 3.0]).file("verify-bad.safetensors");
    let near = triangle().f32("driver.t", &[2], &[3.0f32.next_up(), -1.0]).file("verify-near.safetensors");
    let [good, bad, near] = [&good, &bad, &near].map(|path| path.to_str().expect("UTF-8"));
    let all = ["--max-missed", "0", "--max-extra", "0", "--max-ulp", "0.5"];
    let (code, out, err) = verify(&[&[good][..], &all].concat());
    assert_eq!((code, err.as_str()), (Some(0), ""));
    assert!(out.lines().any(|line| line.starts_with("verify-good  driver")), "{out}");
    let (code, _, err) = verify(&[&[good, bad][..], &all].concat());
    assert_eq!(code, Some(1));
    assert!(err.contains("1 missed against driver, more than 0"), "{err}");
    assert!(err.contains("1 extra against driver, more than 0"), "{err}");
    assert_eq!(verify(&[bad]).0, Some(0), "without limits nothing fails");
    assert_eq!(verify(&[bad, "--max-missed", "1", "--max-extra", "1"]).0, Some(0));
    let (code, _, err) = verify(&[near, "--max-ulp", "0.5"]);
    assert!(code == Some(1) && err.contains("t is 1 ulp off against driver, more than 0.5"), "{err}");
    assert_eq!(verify(&[near, "--max-ulp", "1"]).0, Some(0));
    // There is no reference to judge by.
    assert_eq!(verify(&[bad, "--against", "reference", "--max-missed", "0"]).0, Some(0));

    let broken = triangle().without("ray.origin").file("verify-broken.safetensors");
    let broken = broken.to_str().expect("UTF-8");
    let (code, out, err) = verify(&[broken, good]);
    assert_eq!(code, Some(2));
    assert!(err.contains("verify-broken.safetensors: the tensor `ray.origin` is missing"), "{err}");
    assert!(out.contains("verify-good"), "the others are compared: {out}");
    assert_eq!(verify(&["no/such/file.safetensors"]).0, Some(2));
    let (code, _, err) = verify(&[concat!(env!("CARGO_MANIFEST_DIR"), "/crates/cases/src/recording")]);
    assert!(code == Some(2) && err.contains("the folder contains no `.safetensors` file"), "{err}");
}

#[test]
fn json_holds_the_same() {
    let strange = triangle().f32("ray.t_max", &[2], &[1.0; 2]).file("verify-strange.safetensors");
    let (code, out, _) = verify(&[strange.to_str().expect("UTF-8"), "--json"]);
    assert_eq!(code, Some(0));
    let report: Value = serde_json::from_str(&out).expect("JSON");
    let file = &report["files"][0];
    assert_eq!(file["rays"], 2);
    assert_eq!(file["geometry"], "triangles");
    assert_eq!(file["driver"]["hits"], 1);
    assert_eq!(file["driver"]["t_ulp"]["p99.9"], 0.0);
    assert_eq!(file["ignored_tensors"][0], "ray.t_max");
    assert_eq!(report["failures"], serde_json::json!([]));
}
