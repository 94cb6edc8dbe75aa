//! A whole scene for compiled shaders, written from what their modules declare.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::init::Shaders;
use crate::init::resources::Resources;
use crate::init::traces::BindingTable;
use anyhit_base::error::{Error, ErrorKind, Result, Warning};
use anyhit_base::{atomic_file, escape};
use anyhit_compile::SourceWords;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::RunOptions;
use anyhit_scene::{LoadOptions, RunLimits, SceneFiles, assemble, load};

/// Width and height of the launch.
const LAUNCH: [usize; 2] = [64, 64];

/// A scene that was written.
#[derive(Clone, Debug)]
pub struct WrittenScene {
    /// Its file.
    pub path: PathBuf,
    /// What runs it: `render`, `run` or `trace-one-ray`.
    pub command: &'static str,
    /// Why it does not run yet, where it does not.
    pub failure: Option<Error>,
    /// What the compilers of sources warned of.
    pub warnings: Vec<Warning>,
}

/// Writes a scene file for modules: their shaders in a pipeline, resources with their layouts, a
/// camera, a triangle, a linear swept sphere and what else suits the shaders, a launch and its
/// picture. Then runs it once, within the limits. Sources are compiled as `words` say, and the
/// scene says the same of them.
///
/// # Errors
/// `InvalidArgument` where the file is there already, or no module has an entry point of ray
/// tracing or compute; what reading modules reports. That it does not run yet is no error.
pub fn scene(
    modules: &[PathBuf],
    file: &Path,
    files: &SceneFiles,
    limits: &RunLimits,
    words: &SourceWords,
) -> Result<WrittenScene> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if let Some(root) = &files.root {
        for path in modules.iter().map(PathBuf::as_path).chain([folder]) {
            root.resolve(path)?;
        }
    }
    if file.exists() {
        let message = format!("{} already exists", escape::path(&file));
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    let mut shaders = Shaders::default();
    for path in modules {
        shaders.add(path, files, words, &|stage| !matches!(stage, Stage::Other(_)))?;
    }
    if shaders.all.is_empty() {
        let message = "no module has an entry point of a ray-tracing or compute stage";
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    shaders.check_types()?;
    let text = shaders.whole_scene(folder)?;
    atomic_file::write(file, &text)?;
    let failure = run(file, files, limits).err();
    let has = |stage| shaders.of(stage).next().is_some();
    let has_picture = text.lines().any(|line| line == "output = true");
    let command = match (has(Stage::RayGeneration), has(Stage::Compute)) {
        (true, _) if has_picture => "render",
        (true, _) | (_, true) => "run",
        (false, false) => "trace-one-ray",
    };
    Ok(WrittenScene { path: file.to_path_buf(), command, failure, warnings: shaders.warnings })
}

fn run(file: &Path, files: &SceneFiles, limits: &RunLimits) -> Result<()> {
    let mut scene = load(file, files, &LoadOptions::default())?;
    limits.give(&mut scene);
    let assembled = assemble(&scene)?;
    assembled.run(&assembled.resources, RunOptions::default()).map(|_| ())
}

impl Shaders {
    fn whole_scene(&self, folder: &Path) -> Result<String> {
        let has = |stage| self.of(stage).next().is_some();
        // Outputs are mostly indexed by the launch.
        let [width, height] = LAUNCH;
        let resources = Resources::of(&self.all, width * height);
        let mut out = String::from("version = 1\n");
        if has(Stage::RayGeneration) {
            // Writing to a string does not fail.
            let _ = writeln!(out, "launch = [{width}, {height}]");
        }
        out.push_str(&resources.push_constants().unwrap_or_default());
        out.push_str("\n[shaders]\n");
        out.push_str(&self.file_lines(folder)?);
        let traces = self.all.iter().any(|shader| shader.entry.stage != Stage::Compute);
        if traces {
            out.push_str(&self.pipeline(&resources));
        }
        for shader in self.of(Stage::Compute) {
            let _ = writeln!(out, "\n[[dispatch]]\nshader = {:?}\ngroups = [1, 1, 1]", shader.reference);
        }
        out.push_str(&self.shapes());
        out.push_str(&resources.text_with_camera());
        if traces && !has(Stage::RayGeneration) {
            out.push_str("\n[[ray]]\nname = \"head-on\"\norigin = [-1, 0, 5]\ndirection = [0, 0, -1]\n");
        }
        Ok(out)
    }

    /// Geometry that suits the hit groups, an instance of each.
    fn shapes(&self) -> String {
        const TRIANGLE: &str = "type = \"triangles\"\nvertices = [[-2, -1, 0], [0, -1, 0], [-1, 1, 0]]";
        const ROD: &str = "type = \"lss\"\npositions = [[0.75, -0.5, 0], [1.5, 0.5, 0]]\nradii = [0.5, 0.25]";
        const BALL: &str = "type = \"spheres\"\npositions = [[-1, 0, 0]]\nradii = 0.75";
        const BOX: &str = "type = \"aabbs\"\nboxes = [[[-2, -1, -1], [0, 1, 1]]]";
        let BindingTable { records, slots, .. } = self.binding_table();
        let groups = self.groups();
        let mut out = String::new();
        // The groups of one instance are for rays of several kinds.
        let firsts = (0..groups.len().max(1)).step_by(slots.len());
        for (instance, group) in firsts.enumerate() {
            let members = groups.get(group).map_or(&[][..], |members| members);
            let reads = |word: &str| members.iter().any(|shader| shader.reads(word));
            let shapes: &[(&str, &str)] = if members.iter().any(|one| one.entry.stage == Stage::Intersection)
            {
                &[("box", BOX)]
            } else if reads("LSS") {
                &[("rod", ROD)]
            } else if reads("Sphere") {
                &[("ball", BALL)]
            } else if reads("HitTriangleVertex") {
                &[("triangle", TRIANGLE)]
            } else {
                &[("triangle", TRIANGLE), ("rod", ROD)]
            };
            for (name, lines) in shapes {
                let name = if instance == 0 { (*name).to_owned() } else { format!("{name}_{instance}") };
                let _ = writeln!(out, "\n[geometry.{name}]\n{lines}\n\n[[instance]]\ngeometry = \"{name}\"");
                if instance > 0 {
                    // Beside those of the groups before, so that rays meet all.
                    let (sbt_offset, y) = (instance * records, 2 * instance);
                    let _ = writeln!(out, "sbt_offset = {sbt_offset}\ntranslate = [0, {y}, 0]");
                }
            }
        }
        out
    }
}
