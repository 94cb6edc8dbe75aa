//! Materials, textures and cameras of mesh files as plain data.

use std::path::PathBuf;
use std::sync::Arc;

use crate::read::Named;
use anyhit_engine::machine::sampler::Sampler;
use anyhit_engine::math::float::Float;

/// A material: glTF's metallic-roughness model, and what an .mtl file adds. The defaults are those
/// of glTF 2.0, 5.19 and 5.22.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file.
    pub name: String,
    /// `baseColorFactor`; of an .mtl file `Kd` and `d`.
    pub base_color: [f32; 4],
    /// `metallicFactor`; of an .mtl file `Pm`, or 0.
    pub metallic: f32,
    /// `roughnessFactor`; of an .mtl file `Pr`, or 1.
    pub roughness: f32,
    /// `emissiveFactor`; of an .mtl file `Ke`.
    pub emissive: [f32; 3],
    /// `KHR_materials_emissive_strength`
    pub emissive_strength: f32,
    /// The scale of the normal map.
    pub normal_scale: f32,
    /// The strength of the occlusion map.
    pub occlusion_strength: f32,
    /// Below it an alpha-tested surface is not there.
    pub alpha_cutoff: f32,
    /// 0 opaque, 1 alpha-tested, 2 blended.
    pub alpha_mode: u32,
    /// Whether both sides are seen.
    pub double_sided: bool,
    /// `KHR_materials_ior`; of an .mtl file `Ni`.
    pub ior: f32,
    /// `KHR_materials_transmission`
    pub transmission: f32,
    /// `Ka` of an .mtl file.
    pub ambient: [f32; 3],
    /// `Ks` of an .mtl file.
    pub specular: [f32; 3],
    /// `Ns` of an .mtl file.
    pub shininess: f32,
    /// `illum` of an .mtl file.
    pub illumination: u32,
    /// The texture of each [`TextureSlot`], an index into the model's textures.
    pub textures: [Option<usize>; TextureSlot::COUNT],
    /// How each of them is mapped.
    pub mappings: [TextureMapping; TextureSlot::COUNT],
}

/// The coordinates at which a texture is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureMapping {
    /// `texCoord`: the number of the attribute.
    pub texcoord: u32,
    /// `KHR_texture_transform`: two rows that are multiplied with (u, v, 1).
    pub transform: [[f32; 3]; 2],
}

impl Default for TextureMapping {
    fn default() -> Self {
        Self { texcoord: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] }
    }
}

impl TextureMapping {
    /// Scaled, then turned by an angle in radians, counter-clockwise with v down, then moved.
    pub fn new(texcoord: u32, scale: [f32; 2], rotation: f32, offset: [f32; 2]) -> Self {
        let rotation = f64::from(rotation);
        let (sine, cosine) = (Float::sin(rotation), Float::cos(rotation));
        let [x, y] = scale.map(f64::from);
        let row = |u: f64, v: f64, offset: f32| [u as f32, v as f32, offset];
        let transform = [row(cosine * x, sine * y, offset[0]), row(-sine * x, cosine * y, offset[1])];
        Self { texcoord, transform }
    }

    /// Transforms texture coordinates, rounded once.
    pub fn apply(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let [u, v] = [u, v].map(f64::from);
        self.transform.map(|[a, b, c]| (f64::from(a) * u + f64::from(b) * v + f64::from(c)) as f32)
    }
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [1.0; 4],
            metallic: 1.0,
            roughness: 1.0,
            emissive: [0.0; 3],
            emissive_strength: 1.0,
            normal_scale: 1.0,
            occlusion_strength: 1.0,
            alpha_cutoff: 0.5,
            alpha_mode: 0,
            double_sided: false,
            ior: 1.5,
            transmission: 0.0,
            ambient: [0.0; 3],
            specular: [0.0; 3],
            shininess: 0.0,
            illumination: 0,
            textures: [None; TextureSlot::COUNT],
            mappings: [TextureMapping::default(); TextureSlot::COUNT],
        }
    }
}

/// What a texture of a material is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureSlot {
    /// `baseColorTexture`, `map_Kd`
    BaseColor,
    /// `metallicRoughnessTexture`
    MetallicRoughness,
    /// `normalTexture`, `map_Bump`
    Normal,
    /// `occlusionTexture`
    Occlusion,
    /// `emissiveTexture`
    Emissive,
    /// `map_Ks`
    Specular,
    /// `map_d`
    Alpha,
}

impl TextureSlot {
    /// How many there are.
    pub const COUNT: usize = 7;

    /// Whether its texels of 8 bits are colours, encoded as sRGB (glTF 2.0, 3.9.2, 3.9.3).
    pub fn is_color(self) -> bool {
        matches!(self, Self::BaseColor | Self::Emissive | Self::Specular)
    }

    /// The name as a scene writes it.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize].0
    }
}

impl Named for TextureSlot {
    const WHAT: &'static str = "texture of a material";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("base_color", Self::BaseColor),
        ("metallic_roughness", Self::MetallicRoughness),
        ("normal", Self::Normal),
        ("occlusion", Self::Occlusion),
        ("emissive", Self::Emissive),
        ("specular", Self::Specular),
        ("alpha", Self::Alpha),
    ];
}

/// A picture with the way it is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Where its picture is.
    pub picture: PictureSource,
    /// Its sampler.
    pub sampler: Sampler,
}

/// Where the picture of a texture is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PictureSource {
    /// A file of its own.
    File(PathBuf),
    /// Bytes of a buffer of the mesh file, or of a data URI.
    Bytes(Arc<[u8]>),
    /// None that is read, for this reason.
    Missing(String),
}

/// A camera of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileCamera {
    /// The name of its node, or else of the camera itself.
    pub name: String,
    /// Its path in the file.
    pub path: String,
    /// Camera to world, before the model's own transform.
    pub world: glam::DMat4,
    /// How it projects.
    pub projection: Projection,
}

/// How a camera projects: glTF 2.0, 3.10.3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// From a point.
    Perspective {
        /// Half of the vertical angle's tangent.
        slope: f64,
        /// Width divided by height, where the camera fixes it.
        aspect: Option<f64>,
        /// The distance of the near plane.
        near: f64,
        /// The distance of the far plane, which may be infinite.
        far: f64,
    },
    /// Along parallel lines.
    Orthographic {
        /// Half of the width and half of the height.
        half: [f64; 2],
        /// The distance of the near plane.
        near: f64,
        /// The distance of the far plane.
        far: f64,
    },
}
