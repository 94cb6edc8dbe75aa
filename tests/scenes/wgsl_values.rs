//! Data by member name for variables of WGSL, which naga wraps in structs without names.

use anyhit::{LoadedScene, Result};

const SHADER: &str = "struct Params { scale: f32, offset: vec2f }
    struct Nested { inner: Params, count: u32 }
    @group(0) @binding(0) var<storage, read_write> o: array<f32, 12>;
    @group(0) @binding(1) var<uniform> params: Params;
    @group(0) @binding(2) var<uniform> number: f32;
    @group(0) @binding(3) var<uniform> vector: vec4f;
    @group(0) @binding(4) var<uniform> matrix: mat2x2f;
    @group(0) @binding(5) var<storage> list: array<Params>;
    @group(0) @binding(6) var<storage> nested: Nested;
    @group(0) @binding(7) var<uniform> four: array<vec4f, 2>;
    @group(0) @binding(8) var<uniform> tall: mat4x4f;
    @compute @workgroup_size(1)
    fn main() {
        o[0] = params.scale; o[1] = params.offset.y; o[2] = number; o[3] = vector.z; o[4] = matrix[1].x;
        o[5] = list[1].offset.x; o[6] = nested.inner.offset.y; o[7] = f32(nested.count); o[8] = four[1].w;
        o[9] = tall[3].y; o[10] = f32(arrayLength(&list));
    }";

fn launched(of: &[(u32, &str, &str)]) -> Result<Vec<f32>> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("main.wgsl"), SHADER).expect("a file");
    let mut text = "version = 1\n[shaders]\na = 'main.wgsl'\n[[dispatch]]\nshader = 'a'\n[resources.o]\n\
                    type = 'storage_buffer'\nbinding = 0\nsize = 48\n"
        .to_owned();
    for (binding, kind, value) in of {
        text +=
            &format!("[resources.r{binding}]\ntype = '{kind}_buffer'\nbinding = {binding}\ndata = {value}\n");
    }
    LoadedScene::from_text(folder.path().join("scene.toml"), &text)?.launch()?.read_buffer("o")
}

const ALL: [(u32, &str, &str); 8] = [
    (1, "uniform", "{ value = { scale = 2, offset = [3, 4] } }"),
    (2, "uniform", "{ value = 2.5 }"),
    (3, "uniform", "{ value = [1, 2, 3, 4] }"),
    (4, "uniform", "{ value = [[1, 2], [7, 8]] }"),
    (5, "storage", "{ value = [{ scale = 1, offset = [2, 3] }, { scale = 4, offset = [5, 6] }] }"),
    (6, "storage", "{ value = { inner = { offset = [8, 9] }, count = 11 }, rest = 'zeros' }"),
    (7, "uniform", "{ value = [[1, 2, 3, 4], [5, 6, 7, 8]] }"),
    (8, "uniform", "{ value = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [20, 21, 22, 23]] }"),
];

#[test]
fn each_variable_takes_a_value_of_its_own_type() -> Result<()> {
    assert_eq!(launched(&ALL)?, [2.0, 4.0, 2.5, 3.0, 7.0, 5.0, 9.0, 11.0, 8.0, 21.0, 2.0, 0.0]);
    Ok(())
}

#[test]
fn mistakes_name_the_members_inside() {
    for (value, words) in [
        ("{ value = { scal = 2, offset = [3, 4] } }", "did you mean `scale`?"),
        ("{ value = { scale = 2 } }", "missing value for `offset`"),
        ("{ value = 2 }", "expected a table of its members"),
    ] {
        let mut all = ALL;
        all[0].2 = value;
        let error = launched(&all).expect_err(value).render();
        assert!(error.contains(words), "{value}: {error}");
    }
}
