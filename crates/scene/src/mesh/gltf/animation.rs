//! Animations at a time: the transforms of nodes and the weights of morph targets (glTF 2.0, 3.11
//! and appendix C).

use serde::Deserialize;

use crate::mesh::gltf::accessor::Expected;
use crate::mesh::gltf::document::{ComponentType, Document, Shape};
use crate::mesh::gltf::{Data, get, invalid, read_value};
use crate::mesh::listed::AnimationTime;
use anyhit_base::error::names::list_of;
use anyhit_base::error::{Error, ErrorKind, Result};

/// An animation of a file.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Content {
    channels: Vec<Channel>,
    samplers: Vec<Sampler>,
}

#[derive(Debug, Deserialize)]
struct Channel {
    sampler: usize,
    target: Target,
}

#[derive(Debug, Deserialize)]
struct Target {
    node: Option<usize>,
    path: String,
}

#[derive(Debug, Deserialize)]
struct Sampler {
    input: usize,
    output: usize,
    #[serde(default)]
    interpolation: Interpolation,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "UPPERCASE")]
enum Interpolation {
    #[default]
    Linear,
    Step,
    CubicSpline,
}

/// The animation of a file that a scene selects, at a time.
pub(super) struct SelectedAnimation {
    content: Content,
    path: String,
    time: f64,
}

impl SelectedAnimation {
    /// Selects an animation by its name; without one the first.
    ///
    /// # Errors
    /// `InvalidMesh` where the file has none, or a broken one.
    pub(super) fn new(document: &Document, selected: &AnimationTime) -> Result<Self> {
        let all = &document.animations;
        let names = all.iter().map(|animation| animation["name"].as_str().unwrap_or_default());
        let at = match &selected.animation {
            None => (!all.is_empty()).then_some(0),
            Some(wanted) => names.clone().position(|name| name == wanted),
        };
        let at = at.ok_or_else(|| {
            let message = match &selected.animation {
                Some(name) if !all.is_empty() => format!("the file has no animation `{name}`"),
                _ => "the file has no animation".to_string(),
            };
            let error = Error::new(ErrorKind::InvalidMesh, message);
            if all.is_empty() {
                error
            } else {
                error.note(format!("animations in the file: {}", list_of(names)))
            }
        })?;
        let path = format!("animations[{at}]");
        let content: Content = read_value(&all[at], &path)?;
        Ok(Self { content, path, time: selected.time.into() })
    }

    /// The accessors of the animation.
    pub(super) fn accessors(&self) -> impl Iterator<Item = usize> {
        self.content.samplers.iter().flat_map(|sampler| [sampler.input, sampler.output])
    }

    /// Moves the nodes of a document to the time.
    ///
    /// # Errors
    /// `InvalidMesh` for an animation that cannot be read.
    pub(super) fn apply(&self, data: &mut Data) -> Result<()> {
        for (at, Channel { sampler, target }) in self.content.channels.iter().enumerate() {
            // Channels without a node are those of extensions.
            let Some(node) = target.node else { continue };
            let path = format!("{}.channels[{at}]", self.path);
            let own = get(&data.document.nodes, node, "nodes", &format!("{path}.target"))?;
            let (size, shape) = match target.path.as_str() {
                "translation" | "scale" => (3, Shape::Vec3),
                "rotation" => (4, Shape::Vec4),
                "weights" => (own.mesh.map_or(0, |mesh| data.targets(mesh)), Shape::Scalar),
                other => return Err(invalid(format!("`{path}.target.path` is `{other}`"))),
            };
            if size == 0 {
                continue;
            }
            let name = format!("{}.samplers", self.path);
            get(&self.content.samplers, *sampler, &name, &path)?;
            let value = self.value(data, *sampler, shape, size)?;
            let value: Vec<f32> = value.into_iter().map(|x| x as f32).collect();
            let node = &mut data.document.nodes[node];
            match (target.path.as_str(), &value[..]) {
                ("translation", [x, y, z]) => node.translation = Some([*x, *y, *z]),
                ("scale", [x, y, z]) => node.scale = Some([*x, *y, *z]),
                ("rotation", [x, y, z, w]) => node.rotation = Some([*x, *y, *z, *w]),
                _ => {
                    node.weights = Some(value);
                    continue;
                }
            }
            node.matrix = None;
        }
        Ok(())
    }

    /// Returns the value of a sampler, of `size` components: several of the output's elements where
    /// these are scalars. Those of four components are quaternions.
    fn value(&self, data: &Data, at: usize, shape: Shape, size: usize) -> Result<Vec<f64>> {
        use ComponentType as T;
        let sampler = &self.content.samplers[at];
        let path = format!("{}.samplers[{at}]", self.path);
        let numbers = |accessor: usize, key: &str, shape: Shape, components: &[T]| {
            let expected = Expected { shapes: &[shape], components };
            let numbers = data.elements(accessor, &expected, &format!("{path}.{key}"))?.numbers();
            Ok::<_, Error>(numbers.values.into_iter().map(f64::from).collect::<Vec<_>>())
        };
        let times = numbers(sampler.input, "input", Shape::Scalar, &[T::F32])?;
        let values = numbers(sampler.output, "output", shape, &[T::F32, T::I8, T::U8, T::I16, T::U16])?;
        let is_cubic = sampler.interpolation == Interpolation::CubicSpline;
        let per_key = size * if is_cubic { 3 } else { 1 };
        if values.len() != per_key * times.len() {
            let (found, wanted) = (values.len(), per_key * times.len());
            return Err(invalid(format!("`{path}.output` has {found} numbers, expected {wanted}")));
        }
        let value = |key: usize| {
            let begin = key * per_key + if is_cubic { size } else { 0 };
            values[begin..begin + size].to_vec()
        };
        // Before the first key and behind the last one the value does not change.
        let next = times.partition_point(|time| *time <= self.time);
        if next == 0 || next == times.len() {
            return Ok(value(next.saturating_sub(1)));
        }
        let (key, span) = (next - 1, times[next] - times[next - 1]);
        let t = (self.time - times[key]) / span;
        let (one, other) = (value(key), value(next));
        let mix = |[a, b]: [f64; 2]| one.iter().zip(&other).map(|(x, y)| a * x + b * y).collect::<Vec<_>>();
        Ok(match sampler.interpolation {
            Interpolation::Step => one,
            Interpolation::Linear if shape == Shape::Vec4 => {
                let cosine: f64 = one.iter().zip(&other).map(|(x, y)| x * y).sum();
                normalized(mix(slerp_weights(cosine, t)))
            }
            Interpolation::Linear => mix([1.0 - t, t]),
            Interpolation::CubicSpline => {
                let (t2, t3) = (t * t, t * t * t);
                let leaving = &values[key * per_key + 2 * size..][..size];
                let arriving = &values[next * per_key..][..size];
                let mut all = mix([2.0 * t3 - 3.0 * t2 + 1.0, 3.0 * t2 - 2.0 * t3]);
                for (value, (out, into)) in all.iter_mut().zip(leaving.iter().zip(arriving)) {
                    *value += span * ((t3 - 2.0 * t2 + t) * out + (t3 - t2) * into);
                }
                if shape == Shape::Vec4 { normalized(all) } else { all }
            }
        })
    }
}

/// The weights of two unit quaternions with this scalar product, for a fraction of the shorter turn
/// between them (glTF 2.0, C.4).
fn slerp_weights(cosine: f64, t: f64) -> [f64; 2] {
    let sign = if cosine < 0.0 { -1.0 } else { 1.0 };
    let angle = pxfm::f_acos(cosine.abs().min(1.0));
    let sine = pxfm::f_sin(angle);
    match sine > 1e-6 {
        true => [pxfm::f_sin(angle * (1.0 - t)) / sine, sign * pxfm::f_sin(angle * t) / sine],
        false => [1.0 - t, sign * t],
    }
}

fn normalized(mut quaternion: Vec<f64>) -> Vec<f64> {
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 {
        quaternion.iter_mut().for_each(|x| *x /= length);
    }
    quaternion
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::mesh::gltf::test_file::{TestFile, vertices};
    use crate::mesh::listed::AnimationTime;

    /// The file with an animation of node 0 with keys at 1 s and 3 s.
    fn animated(path: &str, shape: &str, values: &[f32], interpolation: &str) -> TestFile {
        let mut file = TestFile::triangle();
        let input = file.floats("SCALAR", &[1., 3.]);
        let output = file.floats(shape, values);
        file.document["animations"] = json!([{ "name": "move",
            "channels": [
                { "sampler": 0, "target": { "node": 0, "path": path } },
                { "sampler": 9, "target": { "path": "pointer" } }
            ],
            "samplers": [{ "input": input, "output": output, "interpolation": interpolation }]
        }]);
        file
    }

    fn at(time: f32) -> AnimationTime {
        AnimationTime { time, animation: None }
    }

    /// Where vertex 1, (1, 0, 0), is in the world.
    fn place(file: &TestFile, time: f32) -> [f64; 3] {
        let model = file.open_at(Some(&at(time))).unwrap();
        let world = model.nodes[0].world;
        world.transform_point3(glam::Vec3::from(vertices(&model, 0)[1]).as_dvec3()).to_array()
    }

    #[track_caller]
    fn close(found: [f64; 3], wanted: [f64; 3]) {
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} {wanted:?}");
    }

    /// glTF 2.0, C.1 to C.3: step, linear; constant outside of the keys.
    #[test]
    fn translations_between_keys() {
        let values = [0., 0., 0., 8., 0., 4.];
        let file = animated("translation", "VEC3", &values, "LINEAR");
        close(place(&file, 0.0), [1., 0., 0.]);
        close(place(&file, 1.5), [3., 0., 1.]);
        close(place(&file, 9.0), [9., 0., 4.]);
        let file = animated("translation", "VEC3", &values, "STEP");
        close(place(&file, 2.9), [1., 0., 0.]);
        close(place(&file, 3.0), [9., 0., 4.]);
    }

    /// glTF 2.0, C.5: at t = 1/2 of a span of 2 s the value is (v0 + v1) / 2 + 2 (b0 - a1) / 8.
    #[test]
    fn cubic_splines_have_tangents() {
        let zero = [0.; 3];
        let values = [zero, [0., 0., 0.], [4., 0., 0.], [0., 8., 0.], [2., 2., 2.], zero];
        let file = animated("translation", "VEC3", values.as_flattened(), "CUBICSPLINE");
        close(place(&file, 2.0), [1. + 1. + 1., 1. - 2., 1.]);
        close(place(&file, 1.0), [1., 0., 0.]);
        close(place(&file, 3.0), [3., 2., 2.]);
    }

    /// glTF 2.0, C.4: the shorter turn, here to 90 degrees about z with the negative quaternion.
    #[test]
    fn rotations_take_the_shorter_turn() {
        let half = 0.5_f32.sqrt();
        let file = animated("rotation", "VEC4", &[0., 0., 0., 1., 0., 0., -half, -half], "LINEAR");
        // A third of 90 degrees.
        close(place(&file, 1.0 + 2.0 / 3.0), [0.75_f64.sqrt(), 0.5, 0.]);
    }

    #[test]
    fn four_weights_are_not_a_quaternion() {
        let mut file = animated("weights", "SCALAR", &[0., 0., 0., 2., 0., 0., 4., 0.], "LINEAR");
        let targets = [[0., 0., 1.], [0., 1., 0.], [0., 2., 0.], [4., 0., 0.]];
        let targets = targets.map(|moved| json!({ "POSITION": file.floats("VEC3", &moved.repeat(3)) }));
        file.document["meshes"][0]["primitives"][0]["targets"] = json!(targets);
        // A quarter of the way: the weights are 0, 0, 1 and 1.5.
        close(place(&file, 1.5), [1. + 6., 2., 0.]);
    }

    #[test]
    fn weights_are_animated() {
        let mut file = animated("weights", "SCALAR", &[0., 1., 1., 0.], "LINEAR");
        let up = file.floats("VEC3", &[0., 0., 4.].repeat(3));
        let right = file.floats("VEC3", &[8., 0., 0.].repeat(3));
        file.document["meshes"][0]["primitives"][0]["targets"] =
            json!([{ "POSITION": up }, { "POSITION": right }]);
        close(place(&file, 1.5), [1. + 6., 0., 1.]);
    }

    #[test]
    fn animations_are_selected_by_name_and_not_listed_as_unread() {
        let mut file = animated("translation", "VEC3", &[0., 0., 0., 8., 0., 4.], "LINEAR");
        let second = json!({ "name": "rest", "channels": [], "samplers": [] });
        file.document["animations"].as_array_mut().unwrap().push(second);
        let select = |name: &str| AnimationTime { time: 2.0, animation: Some(name.to_string()) };
        let model = file.open_at(Some(&select("rest"))).unwrap();
        assert_eq!(
            (model.nodes[0].world.w_axis.x, &model.unread[..]),
            (0.0, &["1 animation".to_string()][..])
        );
        let model = file.open_at(Some(&select("move"))).unwrap();
        assert_eq!(model.nodes[0].world.w_axis.x, 4.0);
        let error = file.open_at(Some(&select("run"))).unwrap_err().render();
        assert!(error.contains("no animation `run`") && error.contains("move, rest"), "{error}");
        let error = TestFile::triangle().open_at(Some(&at(1.0))).unwrap_err();
        assert!(error.message().contains("the file has no animation"), "{error}");
    }

    #[test]
    fn broken_animations_are_errors_with_their_path() {
        let file = animated("translation", "VEC3", &[0., 0., 0.], "LINEAR");
        let error = file.open_at(Some(&at(1.0))).unwrap_err();
        let wanted = "`animations[0].samplers[0].output` has 3 numbers, expected 6";
        assert!(error.message().contains(wanted), "{error}");
        file.open().unwrap();
        let mut file = animated("translation", "VEC3", &[0.; 6], "LINEAR");
        file.document["animations"][0]["samplers"][0]["interpolation"] = "SMOOTH".into();
        let error = file.open_at(Some(&at(1.0))).unwrap_err();
        assert!(error.message().contains("`animations[0].samplers[0].interpolation`: unknown"), "{error}");
    }
}
