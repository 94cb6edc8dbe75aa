//! Launches and dispatches by the size of the pipeline, of the picture and of paths.

use crate::bounce_shaders;
use crate::curve::Curve;
use crate::fit::Growth;
use crate::measure::Work;
use crate::scene_text::{SceneText, compute_scene, each, write};
use crate::seeds::for_each_invocation;

const RUN: [&str; 2] = ["run", "scene.toml"];
const RENDER: [&str; 4] = ["render", "scene.toml", "--output", "picture.png"];

/// The curves of runs.
pub fn curves() -> Vec<Curve> {
    let hundreds = [16, 64, 256, 1024];
    let thousands = [64, 256, 1024, 4096];
    vec![
        Curve::linear("run: depth of callable shaders", hundreds, |folder, n| {
            write(folder, "rgen.spv", bounce_shaders::calling_ray_generation());
            write(folder, "call.spv", bounce_shaders::callable());
            let text = format!(
                "version = 1\nlaunch = [16, 16]\n[shaders]\nraygen = \"rgen.spv\"\ncall = \"call.spv\"\n\
                 [pipeline]\nraygen = \"raygen\"\ncallable = [\"call\"]\nmax_callable_depth = {n}\n\
                 [resources.words]\ntype = \"storage_buffer\"\nbinding = 1\ndata = {{ u32 = [{}, 0] }}\n",
                n - 1
            );
            write(folder, "scene.toml", text);
            Work::command(RUN)
        }),
        Curve::linear("run: depth of rays", hundreds, |folder, n| {
            let pipeline = format!("max_recursion_depth = {n}\n");
            SceneText { launch: [16, 16], depth: n - 1, pipeline, ..SceneText::default() }.write(folder);
            Work::command(RUN)
        }),
        Curve::linear("run: layers of any-hit shaders", thousands, |folder, n| {
            let layer = |at: usize| {
                let z = -(at as f64) / n as f64;
                format!("[-9, -9, {z:?}], [9, -9, {z:?}], [0, 18, {z:?}], ")
            };
            let geometry = format!("type = \"triangles\"\nvertices = [{}]\n", each(n, layer));
            let hit = "{ closest_hit = \"hit\", any_hit = \"ignore\" }".to_owned();
            SceneText { launch: [16, 16], geometry, hit, ..SceneText::default() }.write(folder);
            Work::command(RUN)
        }),
        Curve::linear("run: records of hit groups", [256, 1024, 4096, 16_384], |folder, n| {
            let hit = each(n, |at| format!("{{ closest_hit = \"hit\", record = {{ u32 = {at} }} }},\n"));
            let instances = format!("[[instance]]\ngeometry = \"wall\"\nsbt_offset = {}\n", n - 1);
            SceneText { hit, instances, ..SceneText::default() }.write(folder);
            Work::command(RUN)
        }),
        Curve::linear("run: dispatches", thousands, |folder, n| {
            write(folder, "main.spv", for_each_invocation(|_, number| number));
            let more = format!(
                "[resources.words]\ntype = \"storage_buffer\"\nbinding = 1\nsize = 1024\n\n{}",
                each(n, |_| "[[dispatch]]\nshader = \"main\"\n\n".into())
            );
            write(folder, "scene.toml", compute_scene(1, &more));
            Work::command(RUN)
        }),
        Curve::linear("run: passes", thousands, |folder, n| {
            let passes = each(n, |_| "[[pass]]\nraygen = \"raygen\"\n\n".into());
            SceneText { launch: [8, 8], ..SceneText::with(passes) }.write(folder);
            Work::command(RUN)
        }),
        Curve::linear("run: groups of a dispatch", [1 << 8, 1 << 10, 1 << 12, 1 << 14], |folder, n| {
            write(folder, "main.spv", for_each_invocation(|_, number| number));
            let size = 4 * (64 * n + 1);
            let words = format!("[resources.words]\ntype = \"storage_buffer\"\nbinding = 1\nsize = {size}\n");
            write(folder, "scene.toml", compute_scene(n, &words));
            Work::command(RUN)
        }),
        Curve::linear("run: rays of an invocation", [1 << 8, 1 << 10, 1 << 12, 1 << 14], |folder, n| {
            SceneText { launch: [8, 8], rays: n, ..SceneText::default() }.write(folder);
            Work::command(RUN)
        })
        .memory(Growth::Constant),
        Curve::linear("render: pixels", [1 << 12, 1 << 14, 1 << 16, 1 << 18], |folder, n| {
            SceneText::picture(n).write(folder);
            Work::command(RENDER)
        }),
        Curve::linear("render --html: pixels, each explained", [1 << 6, 1 << 8, 1 << 10, 1 << 12], html),
        Curve::linear("render --html: pixels, some explained", [1 << 13, 1 << 15, 1 << 17, 1 << 19], html),
        Curve::linear("trace-one-ray: rays of a path", thousands, |folder, n| {
            SceneText { rays: n, ..SceneText::default() }.write(folder);
            Work::command(["trace-one-ray", "scene.toml", "--pixel", "0,0"])
        }),
        Curve::linear("trace-one-ray: depth of rays", hundreds, |folder, n| {
            let pipeline = format!("max_recursion_depth = {n}\n");
            SceneText { depth: n - 1, pipeline, ..SceneText::default() }.write(folder);
            Work::command(["trace-one-ray", "scene.toml", "--pixel", "0,0"])
        }),
    ]
}

fn html(folder: &std::path::Path, n: usize) -> Work {
    SceneText::picture(n).write(folder);
    let [render, scene, output, file] = RENDER;
    Work::command([render, scene, output, file, "--html", "page.html"])
}
