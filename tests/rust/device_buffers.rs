//! Device addresses in Rust: buffers that hold each other's addresses, given to a pipeline, a
//! shader by itself, a compute shader and a loaded scene. `shaders/pass/addresses/nested` follows
//! pointers from a push constant and a shader record through a scene, instances and materials.

use std::sync::Arc;

use anyhit::{
    ComputeTest, DeviceBuffers, Error, ErrorKind, Explain, Hit, Instance, LoadedScene, Module, Pipeline,
    Program, Ray, Result, Scene, ShaderTest, StructData,
};
use anyhit_engine::pipeline::SbtRecord;

const NESTED: &str = "spirv-fixtures/pass/addresses/nested/nested.slang.spv";
const CASE: &str = "shaders/pass/addresses/nested/scene.toml";

/// A `Material` of the shader: colour, roughness, `next`, eight bytes without use.
fn material(module: &Arc<Module>, roughness: f32, next: u64) -> Result<Vec<u8>> {
    let data = StructData::of(module, "Material")?;
    let data = data.set("colour", [roughness, 1.0, 0.0])?.set("roughness", roughness)?.set("next", next)?;
    Ok(data.bytes().to_vec())
}

/// Two materials in a circle, an instance of the second one, the scene, and the push constants that
/// lead to it.
fn nested(module: &Arc<Module>) -> Result<(DeviceBuffers, StructData, u64)> {
    let mut buffers = DeviceBuffers::new();
    let materials = buffers.reserve("materials", 96)?;
    let instance =
        StructData::of(module, "Instance")?.set("material", materials + 0x40)?.set("scale", 2.0)?;
    let instances = buffers.add("instances", instance.bytes())?;
    let info = buffers.reserve("info", 24)?;
    let scene = StructData::of(module, "SceneInfo")?;
    let scene = scene.set("instances", instances)?.set("self", info)?.set("frame", 7)?;
    buffers.write("info", scene.bytes())?;
    let mut all = material(module, 0.5, materials + 0x40)?;
    all.resize(64, 0);
    all.extend(material(module, 0.25, materials)?);
    buffers.write("materials", &all)?;
    let push = StructData::push_constants(module)?.set("sceneInfo", info)?;
    Ok((buffers, push, materials))
}

#[test]
fn a_pipeline_follows_pointers_of_push_constants_and_records() -> Result<()> {
    let module = Module::open(NESTED)?;
    let (buffers, push, materials) = nested(&module)?;
    let mut builder = Pipeline::builder();
    builder = builder.hit([Program::of(&module, "shade")?])?.miss(Program::of(&module, "sky")?)?;
    let record = StructData::shader_record(&module)?.set("material", materials)?;
    let group = builder.sbt().hit[0].as_ref().expect("the record of the hit group").group;
    builder.sbt().hit[0] = Some(SbtRecord::with_data(group, record.bytes()));
    let pipeline = builder.build()?;
    let triangle = Instance::triangles([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]).opaque();
    let scene = Scene::new([triangle])?.device_buffers(&buffers).push_constants_data(&push);
    let traced = pipeline.trace(&scene, Ray::new([0.0, 0.0, 3.0], [0.0, 0.0, -1.0]))?;
    // Colour (1/4, 1, 0) by 2; two steps on the circle lead back; the record's material is the
    // first one.
    assert_eq!(traced.payload["colour"].vec3(), [0.5, 2.0, 0.0]);
    assert_eq!([traced.payload["roughness"].f32(), traced.payload["other"].f32()], [0.25, 0.5]);
    assert_eq!(traced.payload["frame"].u32(), 7);
    assert!(traced.explain().contains("materials + 0x40"), "{}", traced.explain());
    // The shader leaves t in the instance, whose type is that of the pointer to it.
    let instances = scene.resources().memory.named_buffer("instances").expect("the buffer").0;
    assert_eq!(traced.buffer_at(instances)?["t"].f32(), 3.0);
    assert_eq!(traced.read_buffer_at::<f32>(instances + 12)?, [3.0]);
    // A pointer of the record alone leads to the first material.
    assert_eq!(traced.buffer_at(materials)?[0]["roughness"].f32(), 0.5);
    let error = traced.buffer_at(instances + 8).unwrap_err();
    assert!(error.message().contains("no pointer refers to address 0x200000008"), "{error}");
    // What was given is as it was, unless the ray is to write to it.
    assert_eq!(scene.read_buffer_at::<f32>(instances + 12)?, [0.0]);
    let (mut written, before) = (scene.clone(), scene);
    let _ = pipeline.trace_mut(&mut written, Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]))?;
    let fresh = Scene::new([])?.device_buffers(&buffers);
    for (scene, t) in [(written, 4.0), (before, 0.0), (fresh, 0.0)] {
        assert_eq!(scene.read_buffer_at::<f32>(instances + 12)?, [t]);
    }
    Ok(())
}

#[test]
fn a_shader_by_itself_follows_pointers() -> Result<()> {
    let module = Module::open(NESTED)?;
    let (buffers, push, materials) = nested(&module)?;
    let triangle = Hit::triangle([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]);
    let test = ShaderTest::new(&module, "shade")?
        .hit(triangle.ray(Ray::new([0.0, 0.0, 3.0], [0.0, 0.0, -1.0])))
        .device_buffers(&buffers)
        .push_constants_data(&push)
        .shader_record(&(materials + 0x40));
    for _ in 0..2 {
        let outcome = test.run()?;
        assert_eq!(outcome.payload["other"].f32(), 0.25);
        assert!(outcome.explain().contains("materials + 0x40"), "{}", outcome.explain());
    }
    // These addresses are taken already.
    let error = test.device_buffers(&buffers).run().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidArgument);
    assert!(error.message().contains("overlap `materials`"), "{error}");
    Ok(())
}

#[test]
fn a_compute_shader_reaches_a_structure_by_its_address() -> Result<()> {
    let module = Module::open("tests/scenes/addresses/nodes.spv")?;
    let mut buffers = DeviceBuffers::new();
    let scene = Scene::new([Instance::triangles([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).opaque()])?;
    let (outputs, structure) = (buffers.reserve("outputs", 24)?, buffers.structure(&scene));
    let first = buffers.reserve("first", 16)?;
    buffers.write("first", &[3, first])?;
    let test = ComputeTest::new(&module, "main")?.device_buffers(&buffers).bind_buffer(0, 0, "outputs");
    let outcome = test.clone().push_constants(&[first, structure]).run()?;
    // One node in a circle of its own; the ray at (1/4, 1/4) hits the triangle.
    assert_eq!(outcome.read_buffer::<u32>(0, 0)?, [3, 3, 3, 3, 3, 1]);
    // It is one buffer, bound and at its address.
    assert_eq!(outcome.read_buffer_at::<u32>(outputs)?, [3, 3, 3, 3, 3, 1]);
    let error = test.bind_buffer(0, 1, "output").run().unwrap_err();
    assert_eq!(error.message(), "no buffer with an address is named `output`");
    Ok(())
}

#[test]
fn a_loaded_scene_tells_and_keeps_its_addresses() -> Result<()> {
    let mut scene = LoadedScene::open(CASE)?;
    let outcome = scene.launch()?;
    // A buffer that is bound nowhere has the type of the pointer to it.
    assert_eq!(outcome.buffer("instances")?[1]["t"].f32(), 3.0);
    assert_eq!(outcome.buffer("materials")?[2]["roughness"].f32(), 0.125);
    assert_eq!(outcome.read_buffer::<f32>("materials")?.len(), 24);
    // Sorted by name: info, instances, materials.
    let address = |name| scene.address_of(name);
    let [info, instances, materials] = [address("info")?, address("instances")?, address("materials")?];
    assert_eq!([info, instances, materials], [0x1_0000_0000, 0x2_0000_0000, 0x3_0000_0000]);
    // Other data with the same addresses: both instances have the first material.
    let instance = |scale: f32| [materials, u64::from(scale.to_bits())];
    scene.set_buffer("instances", &[instance(1.0), instance(3.0)])?.set_push_constants(&info)?;
    let outcome = scene.launch()?;
    assert_eq!(outcome.read_buffer::<f32>("outputs")?[..3], [1.0, 0.0, 0.0]);
    assert_eq!(outcome.read_buffer::<f32>("outputs")?[8..11], [3.0, 0.0, 0.0]);
    assert_eq!(scene.address_of("instances")?, instances);
    let message = |error: Error| error.render();
    let error = message(scene.address_of("outputs").unwrap_err());
    assert!(
        error.contains("the scene has no address of a buffer or acceleration structure `outputs`"),
        "{error}"
    );
    let error = message(scene.set_buffer("instance", &[0u32]).unwrap_err());
    assert!(error.contains("did you mean `instances`?"), "{error}");
    Ok(())
}

#[test]
fn an_address_that_data_no_longer_names_stays() -> Result<()> {
    let text = "version = 1\npush_constants = [{ address_of = 'b' }, { address_of = 'world' }]\n\
        shaders.main = 'tests/scenes/addresses/nodes.spv'\n\
        [geometry.g]\ntype = 'triangles'\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nopaque = true\n\
        [[instance]]\ngeometry = 'g'\n[[dispatch]]\nshader = 'main'\n\
        [resources.a]\ntype = 'storage_buffer'\nbinding = 0\nsize = 24\n\
        [resources.b]\ntype = 'buffer'\ndata = [{ u32 = [3, 0] }, { address_of = 'c' }]\n\
        [resources.c]\ntype = 'storage_buffer'\nset = 1\nbinding = 0\n\
        data = [{ u32 = [4, 0] }, { address_of = 'c' }]\n\
        [resources.world]\ntype = 'acceleration_structure'\nset = 1\nbinding = 1\n";
    let mut scene = LoadedScene::from_text("scene.toml", text)?;
    let [b, c, world] = [scene.address_of("b")?, scene.address_of("c")?, scene.address_of("world")?];
    assert_eq!([b, c, world], [0x1_0000_0000, 0x2_0000_0000, 0x3_0000_0000]);
    // Only names gave `c` and `world` their addresses.
    let node = [5u64.to_le_bytes(), c.to_le_bytes()].concat();
    scene.set_push_constants(&[c, world])?.set_buffer("b", &[0u64, 0])?.set_buffer_bytes("c", &node)?;
    assert_eq!([scene.address_of("b")?, scene.address_of("c")?, scene.address_of("world")?], [b, c, world]);
    assert_eq!(scene.launch()?.read_buffer::<u32>("a")?, [5, 5, 5, 5, 5, 1]);
    Ok(())
}
