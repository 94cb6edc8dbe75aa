//! The arguments of `launch`.

use std::path::PathBuf;

use serde::Deserialize;
use serde_json::Value;

use crate::command;
use crate::session::ExplainRequest;
use anyhit_base::error::names::nearest;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_engine::geometry::{Precision, Ray};
use anyhit_scene::LoadOptions;

/// The keys of a launch configuration, as clients write them.
const KEYS: [&str; 12] = [
    "scene",
    "program",
    "pixel",
    "ray",
    "invocation",
    "dispatch",
    "pass",
    "variant",
    "size",
    "precision",
    "stopOnEntry",
    "noDebug",
];

/// Keys that clients use themselves and pass on: those of Visual Studio Code, of Zed and of
/// dap-mode. Keys that begin with `__` are clients' own, too.
const CLIENT_KEYS: [&str; 20] = [
    "type",
    "request",
    "name",
    "presentation",
    "preLaunchTask",
    "postDebugTask",
    "internalConsoleOptions",
    "debugServer",
    "serverReadyAction",
    "suppressMultipleSessionWarning",
    "windows",
    "linux",
    "osx",
    "label",
    "adapter",
    "tcp_connection",
    "cwd",
    "dap-server-path",
    "host",
    "debugPort",
];

/// Checks the keys of a launch configuration.
///
/// # Errors
/// The first key that neither the debugger nor a client knows, with the most similar one.
pub(super) fn check_keys(arguments: &Value) -> Result<()> {
    // A member that is null counts as absent.
    let keys = arguments.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null());
    let unknown = |key: &&String| {
        !KEYS.contains(&key.as_str()) && !CLIENT_KEYS.contains(&key.as_str()) && !key.starts_with("__")
    };
    let Some(key) = keys.map(|(key, _)| key).find(unknown) else { return Ok(()) };
    let error = wrong(format!("the launch configuration has an unknown key `{}`", escape::line(key)));
    Err(match nearest(key, KEYS.into_iter()) {
        Some(near) => error.note(format!("did you mean `{near}`?")),
        None => error.note(format!("the keys are {}", KEYS.join(", "))),
    })
}

/// What is debugged, and how.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct LaunchArguments {
    /// The scene file.
    scene: Option<PathBuf>,
    /// Some clients name what is launched so.
    program: Option<PathBuf>,
    /// A launch index of ray generation.
    pixel: Option<Vec<u32>>,
    /// A ray of the scene by its name, or six numbers.
    ray: Option<GivenText>,
    /// `GlobalInvocationId` of a dispatch.
    invocation: Option<Vec<u32>>,
    /// Which dispatch of the scene, from 0.
    dispatch: Option<usize>,
    /// The pass, by its name or number.
    pass: Option<GivenText>,
    /// The scene's variant.
    variant: Option<String>,
    /// Width and height of the launch.
    size: Option<[u32; 2]>,
    /// The precision of intersections.
    precision: Option<String>,
    /// True to stop at the first line; false by default.
    pub(super) stop_on_entry: bool,
    /// Whether it runs without stopping anywhere.
    pub(super) no_debug: bool,
}

/// A name or numbers.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(untagged)]
enum GivenText {
    Text(String),
    Number(u32),
    Numbers(Vec<f32>),
}

impl GivenText {
    fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(number) => number.to_string(),
            Self::Numbers(numbers) => numbers.iter().map(f32::to_string).collect::<Vec<_>>().join(","),
        }
    }
}

impl LaunchArguments {
    /// The scene file.
    ///
    /// # Errors
    /// Where none is given.
    pub(super) fn scene(&self) -> Result<&PathBuf> {
        let given = self.scene.as_ref().or(self.program.as_ref());
        given.ok_or_else(|| {
            wrong("the launch configuration has no `scene`").note("`scene` is the path of a scene file")
        })
    }

    /// How the scene is read.
    ///
    /// # Errors
    /// For an unknown precision.
    pub(super) fn options(&self) -> Result<LoadOptions> {
        let named = |name: &String| {
            let found = Precision::ALL.into_iter().find(|one| one.name() == name);
            found.ok_or_else(|| {
                let known = Precision::ALL.map(Precision::name).join(", ");
                wrong(format!("`{name}` is not a precision")).note(format!("the precisions are {known}"))
            })
        };
        Ok(LoadOptions {
            size: self.size,
            precision: self.precision.as_ref().map(named).transpose()?,
            variant: self.variant.clone(),
            ..LoadOptions::default()
        })
    }

    /// What is debugged, and what a person calls it.
    ///
    /// # Errors
    /// Where it is more than one thing, or not written as it must be.
    pub(super) fn request(&self) -> Result<(ExplainRequest, String)> {
        let given = [self.pixel.is_some(), self.ray.is_some(), self.invocation.is_some()];
        if given.iter().filter(|given| **given).count() > 1 {
            return Err(wrong("`pixel`, `ray` and `invocation` exclude each other"));
        }
        let (request, name) = if let Some(pixel) = &self.pixel {
            let id = index("pixel", pixel, 2)?;
            (ExplainRequest::Pixel(id), format!("pixel ({})", written(&id, pixel.len())))
        } else if let Some(id) = &self.invocation {
            let dispatch = self.dispatch.unwrap_or(0);
            let id = index("invocation", id, 1)?;
            (ExplainRequest::Invocation { dispatch, id }, format!("invocation ({})", written(&id, 3)))
        } else if let Some(ray) = &self.ray {
            let text = ray.text();
            match command::ray(&text) {
                Ok(Some([origin, direction])) => {
                    let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
                    (ExplainRequest::from(ray), format!("ray {text}"))
                }
                _ => (ExplainRequest::Named(text.clone()), format!("ray \"{text}\"")),
            }
        } else {
            (ExplainRequest::Default, "the first ray".to_owned())
        };
        Ok(match &self.pass {
            Some(pass) => (ExplainRequest::InPass(pass.text(), Box::new(request)), name),
            None => (request, name),
        })
    }
}

fn wrong(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}

/// From `least` to three numbers; those that are missing are 0.
fn index(key: &str, numbers: &[u32], least: usize) -> Result<[u32; 3]> {
    if !(least..=3).contains(&numbers.len()) {
        return Err(wrong(format!("`{key}` has {} numbers: expected {least} to 3", numbers.len())));
    }
    let mut id = [0; 3];
    id[..numbers.len()].copy_from_slice(numbers);
    Ok(id)
}

fn written(id: &[u32; 3], count: usize) -> String {
    id[..count].iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn request(arguments: serde_json::Value) -> Result<(ExplainRequest, String)> {
        serde_json::from_value::<LaunchArguments>(arguments).unwrap().request()
    }

    #[test]
    fn a_launch_names_one_invocation_or_ray() {
        let (what, name) = request(json!({ "pixel": [3, 4], "type": "anyhit" })).unwrap();
        assert_eq!((what, name.as_str()), (ExplainRequest::Pixel([3, 4, 0]), "pixel (3, 4)"));
        let (what, name) = request(json!({ "ray": "chains", "pass": 1 })).unwrap();
        let inner = Box::new(ExplainRequest::Named("chains".into()));
        assert_eq!((what, name.as_str()), (ExplainRequest::InPass("1".into(), inner), "ray \"chains\""));
        let given = request(json!({ "ray": [0, 0, 5, 0, 0, -1] })).unwrap().0;
        assert_eq!(given, request(json!({ "ray": "0,0,5 0,0,-1" })).unwrap().0);
        assert!(request(json!({ "ray": "a", "pixel": [0, 0] })).is_err());
        assert!(request(json!({ "pixel": [0] })).is_err());
    }

    #[test]
    fn unknown_keys_are_errors_with_the_nearest_one() {
        let refused = |arguments| check_keys(&arguments).unwrap_err().render();
        let near = refused(json!({ "scene": "a", "stopAtEntry": true }));
        assert!(near.contains("unknown key `stopAtEntry`") && near.contains("`stopOnEntry`"), "{near}");
        let far = refused(json!({ "environment": {} }));
        assert!(far.contains("unknown key `environment`") && far.contains("invocation, dispatch"), "{far}");
        let clients = json!({ "type": "anyhit", "__sessionId": "1", "preLaunchTask": "build", "scene": "a", "args": null });
        check_keys(&clients).unwrap();
        check_keys(&Value::Null).unwrap();
    }

    /// No member takes an object.
    #[test]
    fn each_key_is_a_member() {
        for key in KEYS {
            let of_wrong_type = json!({ key: { "no": ["such", "type"] } });
            assert!(serde_json::from_value::<LaunchArguments>(of_wrong_type).is_err(), "{key}");
        }
    }

    /// Completion in Visual Studio Code offers the keys, and the default that the adapter has.
    #[test]
    fn the_extension_declares_the_keys_and_the_default() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../editors/vscode/package.json");
        let text = std::fs::read_to_string(path).unwrap();
        let package: Value = serde_json::from_str(&text).unwrap();
        let declared =
            &package["contributes"]["debuggers"][0]["configurationAttributes"]["launch"]["properties"];
        let mut declared_keys: Vec<&str> = declared.as_object().unwrap().keys().map(String::as_str).collect();
        // The first is another name for the scene, the second what "Run Without Debugging" sets.
        declared_keys.extend(["program", "noDebug"]);
        declared_keys.sort_unstable();
        let mut keys = KEYS;
        keys.sort_unstable();
        assert_eq!(declared_keys, keys);
        assert_eq!(declared["stopOnEntry"]["default"], LaunchArguments::default().stop_on_entry);
    }
}
