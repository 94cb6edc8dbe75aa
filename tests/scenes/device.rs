//! Device profiles and pipeline flags, from scene files to what is refused.

use std::path::Path;

use anyhit_base::error::Error;
use anyhit_scene::{DiskFiles, LoadOptions, assemble, load_text};

/// A ball and a capsule seen by the probe of `shaders/pass/conformance`, with more lines.
fn scene(before: &str, pipeline: &str) -> String {
    format!(
        "version = 1\nlaunch = [1]\n{before}\n[shaders]\nraygen = 'probe/main.rgen.spv'\nmiss = 'probe/main.rmiss.spv'\n\
         swept = 'probe/swept.rchit.spv'\n[pipeline]\nraygen = 'raygen'\nmiss = 'miss'\nhit = [{{ closest_hit = 'swept' }}]\n{pipeline}\n\
         [geometry.ball]\ntype = 'spheres'\npositions = [[0, 0, 0]]\nradii = 1\n[[instance]]\ngeometry = 'ball'\n\
         [geometry.capsule]\ntype = 'lss'\npositions = [[0, 0, 0], [1, 0, 0]]\nradii = 1\n[[instance]]\ngeometry = 'capsule'\n"
    )
}

/// Everything that is wrong with it, as one text.
fn refused(before: &str, pipeline: &str) -> Option<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/conformance/scene.toml");
    let text = scene(before, pipeline);
    let found =
        load_text(&root, &text, &DiskFiles, &LoadOptions::default()).and_then(|scene| assemble(&scene));
    let render =
        |error: Error| error.render() + &error.others().iter().map(Error::render).collect::<String>();
    found.err().map(render)
}

fn device(features: &str, limits: &str) -> String {
    format!("[device]\nfeatures = {{ {features} }}\nlimits = {{ {limits} }}")
}

#[test]
fn the_default_device_and_pipeline_refuse_nothing() {
    assert_eq!(refused("", ""), None);
    assert_eq!(refused("[device]\npreset = 'permissive'", ""), None);
}

#[test]
fn a_feature_that_is_off_is_named() {
    for (features, limits, pipeline, wanted) in [
        ("spheres = false", "", "", &["contains spheres", "`spheres`", "None-10429"][..]),
        ("linear_swept_spheres = false", "", "", &["contains linear swept spheres", "None-10419"]),
        (
            "spheres = false",
            "",
            "",
            &["RayTracingSpheresGeometryNV requires the feature `spheres`", "pCode-08740"],
        ),
        ("ray_tracing_maintenance1 = false", "", "", &["RayCullMaskKHR", "`rayTracingMaintenance1`"]),
        (
            "ray_traversal_primitive_culling = false",
            "",
            "flags = ['skip_aabbs', 'allow_spheres_and_linear_swept_spheres']",
            &["`rayTraversalPrimitiveCulling`", "03596"],
        ),
        (
            "",
            "max_ray_recursion_depth = 1",
            "max_recursion_depth = 2",
            &["recursion depth 2 exceeds the limit 1 of", "03589"],
        ),
        ("", "max_instance_count = 1", "", &["2 instances exceed the limit 1 of", "maxInstanceCount"]),
        ("", "max_primitive_count = 0", "", &["1 primitives exceed the limit 0 of", "maxPrimitiveCount"]),
        (
            "",
            "",
            "flags = []",
            &["which the pipeline does not allow", "ALLOW_SPHERES_AND_LINEAR_SWEPT_SPHERES"],
        ),
        ("", "", "flags = ['skip_aabbs', 'skip_triangles']", &["flags-06546"]),
        ("", "", "flags = ['no_null_any_hit_shaders']", &["has no any-hit shader", "flags-03470"]),
    ] {
        let found = refused(&device(features, limits), pipeline).unwrap_or_default();
        for words in wanted {
            assert!(found.contains(words), "{features} {limits} {pipeline}: no `{words}` in:\n{found}");
        }
    }
    let promised = "flags = ['no_null_closest_hit_shaders', 'allow_spheres_and_linear_swept_spheres']";
    assert_eq!(refused("", promised), None, "its only hit group has a closest-hit shader");
}

/// `VUID-VkRayTracingPipelineCreateInfoKHR-flags-03470` and `-03471`: each hit group has the shader
/// that the flag promises.
#[test]
fn hit_groups_have_the_shaders_that_a_pipeline_promises() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/conformance/scene.toml");
    let refused = |group: &str, flag: &str| {
        let text = format!(
            "version = 1\nlaunch = [1]\n[shaders]\nraygen = 'probe/main.rgen.spv'\nmiss = 'probe/main.rmiss.spv'\n\
             any = 'probe/main.rahit.spv'\nclosest = 'probe/triangle.rchit.spv'\n[pipeline]\nraygen = 'raygen'\n\
             miss = 'miss'\nhit = [{{ {group} }}]\nflags = '{flag}'\n[geometry.wing]\ntype = 'triangles'\n\
             vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n[[instance]]\ngeometry = 'wing'\n"
        );
        let found =
            load_text(&root, &text, &DiskFiles, &LoadOptions::default()).and_then(|scene| assemble(&scene));
        found.err().map(|error| error.render())
    };
    let [any, closest] = ["any_hit = 'any'", "closest_hit = 'closest'"];
    let both = format!("{any}, {closest}");
    for (flag, has, lacks, rule) in [
        ("no_null_closest_hit_shaders", closest, any, "flags-03471"),
        ("no_null_any_hit_shaders", any, closest, "flags-03470"),
    ] {
        assert_eq!(refused(has, flag), None);
        assert_eq!(refused(&both, flag), None);
        assert_eq!(refused(lacks, "allow_motion"), None, "nothing is promised");
        let found = refused(lacks, flag).unwrap_or_default();
        assert!(found.contains("-hit shader, but the pipeline has") && found.contains(rule), "{found}");
    }
}

#[test]
fn null_descriptors_and_motion_need_their_features() {
    let features = "[device]\nfeatures = { null_descriptor = false, ray_tracing_motion_blur = false }";
    for (more, wanted) in [
        ("[resources.none]\ntype = 'storage_buffer'\nbinding = 99\nnull = true", "buffer-02998"),
        (
            "[resources.none]\ntype = 'acceleration_structure'\nbinding = 99\nnull = true",
            "pAccelerationStructures-03580",
        ),
        (
            "[geometry.wing]\ntype = 'triangles'\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n\
             vertices_t1 = [[0, 0, 1], [1, 0, 1], [0, 1, 1]]\n[[instance]]\ngeometry = 'wing'",
            "`rayTracingMotionBlur`",
        ),
    ] {
        let found = refused(&format!("{features}\n{more}"), "").unwrap_or_default();
        assert!(found.contains(wanted), "{more}: no `{wanted}` in:\n{found}");
        assert_eq!(refused(more, ""), None, "{more}");
    }
    let image = "[resources.none]\ntype = 'storage_image'\nbinding = 99\nnull = true";
    let found = refused(image, "").unwrap_or_default();
    assert!(found.contains("only buffers and acceleration structures can be null"), "{found}");
    assert!(found.contains("scene.toml:6:8"), "{found}");
}

/// What is wrong with a case of motion under other flags.
fn refused_to_move(case: &str, flags: &str) -> Option<String> {
    let root =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/pass/motion-blur").join(case).join("scene.toml");
    let text = format!(
        "version = 1\nlaunch = 1\ninclude = '../targets.toml'\n\
         [shaders]\nraygen = '../../../../spirv-fixtures/pass/motion-blur/{case}/main.rgen.spv'\n\
         [pipeline]\nraygen = 'raygen'\nmiss = ['miss']\nhit = [{{ closest_hit = 'closest' }}]\n{flags}"
    );
    let found =
        load_text(&root, &text, &DiskFiles, &LoadOptions::default()).and_then(|scene| assemble(&scene));
    found.err().map(|error| error.render() + &error.others().iter().map(Error::render).collect::<String>())
}

#[test]
fn what_moves_needs_a_pipeline_that_allows_it() {
    for (case, instruction, rule) in [
        ("traces", "OpTraceRayMotionNV", "VUID-RuntimeSpirv-OpTraceRayMotionNV-06367"),
        ("nv-hit-objects", "OpHitObjectTraceRayMotionNV", "OpHitObjectTraceRayMotionNV-07711"),
        ("ext-hit-objects", "OpHitObjectTraceRayMotionEXT", "ALLOW_MOTION_BIT_NV is missing"),
    ] {
        assert_eq!(refused_to_move(case, ""), None, "no list of flags allows it");
        assert_eq!(refused_to_move(case, "flags = 'allow_motion'"), None);
        let found = refused_to_move(case, "flags = 'skip_aabbs'").unwrap_or_default();
        let traces =
            format!("shader `main`: {instruction} specifies a time, which the pipeline does not allow");
        for words in [&traces, rule] {
            assert!(found.contains(words), "{case}: no `{words}` in:\n{found}");
        }
    }
    // Rays without a time meet what moves.
    let moving = "[geometry.wing]\ntype = 'triangles'\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n\
         [[instance]]\ngeometry = 'wing'\nmotion = { translate = [0, 0, 1] }";
    let found = refused(moving, "flags = 'allow_spheres_and_linear_swept_spheres'").unwrap_or_default();
    for words in ["instance 0 moves, which the pipeline does not allow", "OpTraceRayKHR-06360"] {
        assert!(found.contains(words), "no `{words}` in:\n{found}");
    }
    let queries =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/pass/motion-blur/ray-queries/scene.toml");
    let text =
        std::fs::read_to_string(&queries).expect("a case").replace("[pipeline]", "[pipeline]\nflags = []");
    let scene = load_text(&queries, &text, &DiskFiles, &LoadOptions::default()).expect("a scene");
    assert!(assemble(&scene).is_ok(), "a ray query needs no flag of a pipeline");
}

/// What is wrong with a launch of the sphere's case whose two bindings are these resources.
fn refused_to_bind(structure: &str, outputs: &str) -> Option<String> {
    let root =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/sphere/closest-hit/scene.toml");
    let text = format!(
        "version = 1\nlaunch = 1\n[shaders]\nraygen = 'main.rgen.spv'\n[pipeline]\nraygen = 'raygen'\n\
         [geometry.ball]\ntype = 'spheres'\npositions = [[0, 0, 0]]\nradii = 1\n[[instance]]\ngeometry = 'ball'\n\
         [resources.scene]\nbinding = 0\n{structure}\n[resources.outputs]\nbinding = 1\n{outputs}\n"
    );
    let found =
        load_text(&root, &text, &DiskFiles, &LoadOptions::default()).and_then(|scene| assemble(&scene));
    found.err().map(|error| error.render() + &error.others().iter().map(Error::render).collect::<String>())
}

#[test]
fn what_is_bound_is_what_shaders_declare() {
    let [structure, buffer] = ["type = 'acceleration_structure'", "type = 'storage_buffer'\nsize = 64"];
    assert_eq!(refused_to_bind(structure, buffer), None);
    assert_eq!(refused_to_bind(structure, "type = 'storage_buffer'\nnull = true"), None);
    let other = "\n[resources.other]\nbinding = 1\nelement = 1\ntype = 'sampler'";
    assert_eq!(refused_to_bind(structure, &format!("{buffer}{other}")), None, "one of several types");
    let uniform = "type = 'uniform_buffer'\nsize = 64";
    let image = "type = 'storage_image'\nformat = 'rgba8'\nsize = [1, 1]";
    for (structure, outputs, wanted) in [
        (structure, uniform, "declares `Outputs` (set 0, binding 1) as `storage_buffer`"),
        (structure, image, "declares `Outputs` (set 0, binding 1) as `storage_buffer`"),
        (image, buffer, "declares `scene` (set 0, binding 0) as `acceleration_structure`"),
    ] {
        let found = refused_to_bind(structure, outputs).unwrap_or_default();
        for words in [
            wanted,
            "RayGenerationKHR `main`",
            "VkRayTracingPipelineCreateInfoKHR-layout-07990",
            "scene.toml:",
        ] {
            assert!(found.contains(words), "no `{words}` in:\n{found}");
        }
    }
}

#[test]
fn mistakes_in_the_table_have_their_place() {
    for (before, wanted) in [
        ("[device]\npreset = 'vulkan_minmum'", "did you mean `vulkan_minimum`?"),
        ("[device]\nfeatures = { sphers = false }", "did you mean `spheres`?"),
        ("[device]\nlimits = { max_ray_recursion = 1 }", "did you mean `max_ray_recursion_depth`?"),
        ("[device]\nfeatures = { spheres = 1 }", "expected true or false"),
    ] {
        let found = refused(before, "").unwrap_or_default();
        assert!(found.contains(wanted) && found.contains("scene.toml:4:"), "{before}: {found}");
    }
    let found = refused("", "flags = ['skip_aabb']").unwrap_or_default();
    assert!(found.contains("did you mean `skip_aabbs`?"), "{found}");
}

/// Recursion: without a depth of its own a pipeline takes what the device has.
#[test]
fn presets_limit_what_a_pipeline_takes_by_itself() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/conformance/scene.toml");
    let depth = |before: &str| {
        let text = scene(before, "");
        let scene = load_text(&root, &text, &DiskFiles, &LoadOptions::default()).expect("a scene");
        assemble(&scene).expect("a pipeline").pipeline.max_recursion
    };
    assert_eq!(depth(""), 31);
    assert_eq!(depth("[device]\nlimits = { max_ray_recursion_depth = 3 }"), 3);
}

/// What is wrong with a case of hit objects on a device with these keys.
fn refused_hit_objects(case: &str, device: &str) -> Option<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/pass/hit-object").join(case);
    let path = path.join("scene.toml");
    let text = std::fs::read_to_string(&path).expect("a case") + "\n[device]\n" + device;
    let found =
        load_text(&path, &text, &DiskFiles, &LoadOptions::default()).and_then(|scene| assemble(&scene));
    found.err().map(|error| error.render() + &error.others().iter().map(Error::render).collect::<String>())
}

#[test]
fn attributes_of_hit_objects_fit_the_device() {
    // A vec2 of the ray generation shader.
    let found = refused_hit_objects("from-query", "limits = { max_ray_hit_attribute_size = 4 }");
    let found = found.unwrap_or_default();
    assert!(found.contains("`main` has hit attributes of 8 bytes, more than the limit 4"), "{found}");
    assert_eq!(refused_hit_objects("from-query", "limits = { max_ray_hit_attribute_size = 8 }"), None);
}

#[test]
fn group_operations_need_a_stage_that_has_them() {
    let found = refused_hit_objects("reordered-subgroups", "features = { ray_tracing_subgroups = false }");
    let found = found.unwrap_or_default();
    for words in ["RayGenerationKHR executes a group operation", "`subgroupSupportedStages`", "None-06343"] {
        assert!(found.contains(words), "no `{words}` in:\n{found}");
    }
    assert_eq!(refused_hit_objects("reordered-subgroups", "preset = 'permissive'"), None);
    assert_eq!(refused_hit_objects("from-query", "features = { ray_tracing_subgroups = false }"), None);
}
