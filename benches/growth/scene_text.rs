//! Scene files of the curves, and the files beside them.

use std::path::Path;

use crate::bounce_shaders;

/// A scene under construction, whose rays hit one wall.
pub struct SceneText {
    /// Width and height of the launch.
    pub launch: [usize; 2],
    /// Rays of an invocation.
    pub rays: usize,
    /// Further rays out of each of their hits.
    pub depth: usize,
    /// Keys of the geometry `wall`.
    pub geometry: String,
    /// Hit groups, as TOML.
    pub hit: String,
    /// Further keys of `[pipeline]`.
    pub pipeline: String,
    /// Instances, unless one of the wall.
    pub instances: String,
    /// Further tables.
    pub more: String,
}

impl Default for SceneText {
    fn default() -> Self {
        let wall = "vertices = [[-9, -9, 0], [9, -9, 0], [0, 18, 0]]\nopaque = true\n";
        Self {
            launch: [1, 1],
            rays: 1,
            depth: 0,
            geometry: format!("type = \"triangles\"\n{wall}"),
            hit: "{ closest_hit = \"hit\" }".into(),
            pipeline: String::new(),
            instances: "[[instance]]\ngeometry = \"wall\"\n".into(),
            more: String::new(),
        }
    }
}

impl SceneText {
    /// A scene with these tables beside its own.
    pub fn with(more: String) -> Self {
        Self { more, ..Self::default() }
    }

    /// A picture of about so many pixels, whose sides are powers of two.
    pub fn picture(pixels: usize) -> Self {
        Self { launch: sides(pixels), ..Self::default() }
    }

    /// The text.
    pub fn text(&self) -> String {
        let Self { launch, rays, depth, geometry, hit, pipeline, instances, more } = self;
        format!(
            "version = 1
launch = {launch:?}

[shaders]
raygen = \"rgen.spv\"
miss = \"miss.spv\"
hit = \"hit.spv\"
ignore = \"ignore.spv\"

[pipeline]
raygen = \"raygen\"
miss = \"miss\"
hit = [{hit}]
{pipeline}

[geometry.wall]
{geometry}

{instances}

[resources.scene]
type = \"acceleration_structure\"
binding = 0

[resources.words]
type = \"storage_buffer\"
binding = 1
data = {{ u32 = [{rays}, {depth}] }}

[resources.picture]
type = \"storage_image\"
binding = 2
output = true

{more}
"
        )
    }

    /// Writes the text and the shaders to a folder, as `scene.toml`.
    pub fn write(&self, folder: &Path) {
        self.write_as(folder, "scene.toml");
    }

    /// Writes the text and the shaders to a folder.
    pub fn write_as(&self, folder: &Path, name: &str) {
        write(folder, "rgen.spv", bounce_shaders::ray_generation());
        write(folder, "miss.spv", bounce_shaders::miss());
        write(folder, "hit.spv", bounce_shaders::closest_hit());
        write(folder, "ignore.spv", bounce_shaders::any_hit());
        write(folder, name, self.text());
    }
}

/// A scene without a launch, which dispatches the compute shader `main.spv`.
pub fn compute_scene(groups: usize, more: &str) -> String {
    format!(
        "version = 1

[shaders]
main = \"main.spv\"

[[dispatch]]
shader = \"main\"
groups = {groups}

{more}
"
    )
}

/// Sides of a picture of so many pixels, a power of two.
pub fn sides(pixels: usize) -> [usize; 2] {
    let height = 1 << (pixels.ilog2() / 2);
    [pixels / height, height]
}

/// Writes a file.
pub fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) {
    std::fs::write(folder.join(name), content).expect("a temporary file");
}

/// Repeats a text for each number below `n`.
pub fn each(n: usize, text: impl Fn(usize) -> String) -> String {
    (0..n).map(text).collect()
}
