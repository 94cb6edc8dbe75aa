//! The probe's shaders and how they are launched.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use anyhit::Scene;
use anyhit::{Module, Program};
use anyhit_engine::machine::{Buffer, Descriptor, ShaderIndex};
use anyhit_engine::pipeline::{Group, HitGroup, Launch, Pipeline, PipelineFlags, RunOptions, SbtRecord};
use anyhit_unit_test::scene::Instance;
use bytemuck::{Pod, Zeroable};

/// Words of a payload: as `probe.glsl` has them.
pub const WORDS: usize = 72;
pub const MISS: u32 = 1;
pub const TRIANGLE: u32 = 2;
pub const BOX: u32 = 3;
pub const SPHERE: u32 = 4;
pub const SWEPT: u32 = 5;

/// A ray, as the ray generation shader reads it.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Shot {
    pub origin: [f32; 3],
    pub t_min: f32,
    pub direction: [f32; 3],
    pub t_max: f32,
    pub flags: u32,
    pub cull_mask: u32,
    pub sbt_offset: u32,
    pub sbt_stride: u32,
    pub miss_index: u32,
    pub padding: [u32; 3],
}

impl Shot {
    /// Down the z axis from a point: t_min 0, t_max 9, flags 0, mask 0xFF, SBT offset 0, stride 1.
    pub fn down(origin: [f32; 3]) -> Self {
        Self {
            origin,
            t_min: 0.0,
            direction: [0.0, 0.0, -1.0],
            t_max: 9.0,
            flags: 0,
            cull_mask: 0xFF,
            sbt_offset: 0,
            sbt_stride: 1,
            miss_index: 0,
            padding: [0; 3],
        }
    }
}

/// What the shaders of a hit record do: the data behind its handle.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Plan {
    pub id: u32,
    pub any_hit: AnyHit,
    pub reports: u32,
    pub t: [f32; 2],
    pub kind: [u32; 2],
}

/// What an any-hit shader does, by number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub struct AnyHit(pub u32);

impl AnyHit {
    pub const ACCEPT: Self = Self(0);
    pub const IGNORE: Self = Self(1);
    pub const TERMINATE: Self = Self(2);
    pub const IGNORE_EVEN: Self = Self(3);
    pub const TERMINATE_IN_A_FUNCTION: Self = Self(4);
    pub const IGNORE_BEYOND_A_HALF: Self = Self(5);
}

/// What a ray brought back.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Probe {
    pub stage: u32,
    pub any_hits: u32,
    pub record: u32,
    pub flags: u32,
    pub primitive: u32,
    pub geometry: u32,
    pub instance: u32,
    pub custom_index: u32,
    pub hit_kind: u32,
    pub t_min: f32,
    pub t_max: f32,
    pub attribute: [f32; 4],
    pub world_origin: [f32; 3],
    pub world_direction: [f32; 3],
    pub object_origin: [f32; 3],
    pub object_direction: [f32; 3],
    pub object_to_world: [[f32; 3]; 4],
    pub world_to_object: [[f32; 3]; 4],
    pub vertices: [[f32; 3]; 3],
    pub seen_flags: u32,
    pub seen_t: f32,
    pub seen_kind: u32,
    pub seen_record: u32,
    pub never: u32,
    pub seen_attribute: [f32; 2],
    pub launch_id: [u32; 3],
    pub launch_volume: u32,
    pub cull_mask: u32,
}

const _: () = assert!(size_of::<Probe>() == 4 * WORDS);

/// Which hit shaders a record has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    Triangle,
    Box,
    /// Spheres and linear swept spheres.
    Swept,
    /// No closest-hit shader, the rest as for triangles.
    NoClosestHit,
    /// No any-hit shader, the rest as for triangles.
    NoAnyHit,
    /// No intersection shader, the rest as for boxes.
    NoIntersection,
    /// A null record.
    Null,
}

/// Ray generation shaders that ask for hits of spheres and linear swept spheres: a trace, a ray
/// query, a hit object, and the last two for one ray, compared word by word.
pub const WAYS: [&str; 4] =
    ["probe/main.rgen", "swept/query.rgen", "swept/hit-object.rgen", "swept/both.rgen"];

/// A pipeline of the probe's shaders.
#[derive(Clone, Debug)]
pub struct Rig {
    raygen: &'static str,
    hits: Vec<(Kind, Plan)>,
    misses: u32,
    flags: PipelineFlags,
}

impl Rig {
    /// One hit record of a kind that accepts, one miss record.
    pub fn of(kind: Kind) -> Self {
        Self::with([(kind, Plan::default())])
    }

    pub fn with(hits: impl IntoIterator<Item = (Kind, Plan)>) -> Self {
        Self { raygen: WAYS[0], hits: hits.into_iter().collect(), misses: 1, flags: PipelineFlags::default() }
    }

    /// Miss records, whose data are 100, 101, ...
    pub fn misses(self, misses: u32) -> Self {
        Self { misses, ..self }
    }

    /// Another ray generation shader than the probe's own.
    pub fn raygen(self, raygen: &'static str) -> Self {
        Self { raygen, ..self }
    }

    pub fn flags(self, flags: PipelineFlags) -> Self {
        Self { flags, ..self }
    }

    /// Launches one invocation a ray.
    pub fn run(&self, instances: impl IntoIterator<Item = Instance>, shots: &[Shot]) -> Vec<Probe> {
        self.launch(instances, shots, [shots.len() as u32, 1, 1]).unwrap_or_else(|error| panic!("{error:?}"))
    }

    /// Launches over a grid of as many invocations as rays.
    pub fn launch(
        &self,
        instances: impl IntoIterator<Item = Instance>,
        shots: &[Shot],
        size: [u32; 3],
    ) -> anyhit::Result<Vec<Probe>> {
        assert_eq!(size.iter().product::<u32>() as usize, shots.len());
        let pipeline = self.pipeline();
        let outputs = Buffer::zeroed(shots.len() * 4 * WORDS);
        let scene = Scene::new(instances)?
            .bind(0, 0)
            .descriptor(0, 1, Descriptor::Buffer(outputs.clone()))
            .buffer(0, 2, shots);
        let launch = Launch { pipeline: &pipeline, resources: scene.resources() };
        launch.run(size, RunOptions::default())?;
        Ok(bytemuck::pod_collect_to_vec(&outputs.bytes()))
    }

    fn pipeline(&self) -> Pipeline {
        let mut builder = Pipeline::builder();
        builder = builder.flags(self.flags);
        builder = builder.ray_generation(program(self.raygen)).expect("a ray generation shader");
        let miss = builder.shader(program("probe/main.rmiss"));
        let miss = builder.group(Group::General(miss)).expect("a miss group");
        let shaders = ["triangle.rchit", "box.rchit", "swept.rchit", "main.rahit", "box.rahit", "main.rint"]
            .map(|name| builder.shader(program(&format!("probe/{name}"))));
        let mut records = Vec::new();
        for &(kind, plan) in &self.hits {
            records.push(group(kind, shaders).map(|group| {
                let group = builder.group(Group::Hit(group)).expect("a hit group");
                SbtRecord::with_data(group, bytemuck::bytes_of(&plan))
            }));
        }
        builder.sbt().hit = records;
        let missed = |at: u32| Some(SbtRecord::with_data(miss, &(100 + at).to_le_bytes()));
        builder.sbt().miss = (0..self.misses).map(missed).collect();
        builder.build().expect("a valid pipeline")
    }
}

fn group(kind: Kind, shaders: [ShaderIndex; 6]) -> Option<HitGroup> {
    let [triangle, procedural, swept, any_hit, box_any_hit, intersection] = shaders.map(Some);
    let of = |closest_hit, any_hit, intersection| Some(HitGroup { closest_hit, any_hit, intersection });
    match kind {
        Kind::Triangle => of(triangle, any_hit, None),
        Kind::Box => of(procedural, box_any_hit, intersection),
        Kind::Swept => of(swept, any_hit, None),
        Kind::NoClosestHit => of(None, any_hit, None),
        Kind::NoAnyHit => of(triangle, None, None),
        Kind::NoIntersection => of(procedural, box_any_hit, None),
        Kind::Null => None,
    }
}

/// A fixture's program, lowered once.
fn program(name: &str) -> Arc<Program> {
    static PROGRAMS: Mutex<BTreeMap<String, Arc<Program>>> = Mutex::new(BTreeMap::new());
    let mut programs = PROGRAMS.lock().unwrap_or_else(PoisonError::into_inner);
    let load = || {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/conformance");
        let module = Module::open(folder.join(format!("{name}.spv"))).expect("a fixture");
        Arc::new(Program::of(&module, "main").expect("a supported fixture"))
    };
    programs.entry(name.to_owned()).or_insert_with(load).clone()
}

/// A triangle around (x, y, z) that shows its front to rays down the z axis, or its back: seen from
/// +z, x to the right and y up, the corners go round counter-clockwise for the front. (Vulkan's
/// clockwise is that of a left-handed system.)
pub fn facing([x, y, z]: [f32; 3], half: f32, front: bool) -> [[f32; 3]; 3] {
    let corners = [[x - half, y - half, z], [x + half, y - half, z], [x, y + half, z]];
    if front { corners } else { [corners[1], corners[0], corners[2]] }
}
