//! The materials, textures and samplers of a glTF file.

use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::files::sibling;
use crate::mesh::gltf::document::{self, AlphaMode, Extensions, TextureInfo};
use crate::mesh::gltf::extension::{EMISSIVE_STRENGTH, IOR, TEXTURE_TRANSFORM, TRANSMISSION};
use crate::mesh::gltf::{Data, get, invalid, read_value};
use crate::mesh::material::{Material, PictureSource, Texture, TextureMapping, TextureSlot};
use crate::mesh::uri::Uri;
use anyhit_base::error::names::list_of;
use anyhit_base::error::{ErrorKind, Result};
use anyhit_engine::machine::sampler::{AddressMode, Filter, Sampler};

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct EmissiveStrength {
    emissive_strength: Option<f32>,
}

#[derive(Deserialize)]
struct Ior {
    ior: Option<f32>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Transmission {
    transmission_factor: Option<f32>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct TextureTransform {
    offset: Option<[f32; 2]>,
    rotation: Option<f32>,
    scale: Option<[f32; 2]>,
    tex_coord: Option<u32>,
}

/// The properties that an extension defines, where an object has them.
fn extension<T: DeserializeOwned>(extensions: &Extensions, name: &str, path: &str) -> Result<Option<T>> {
    let value = extensions.get(name);
    value.map(|value| read_value(value, &format!("{path}.extensions.{name}"))).transpose()
}

impl Data {
    pub(super) fn materials(&self) -> Result<Vec<Material>> {
        let all = self.document.materials.iter().enumerate();
        all.map(|(at, material)| self.material(material, &format!("materials[{at}]"))).collect()
    }

    fn material(&self, material: &document::Material, path: &str) -> Result<Material> {
        use TextureSlot as S;
        let pbr = &material.pbr_metallic_roughness;
        let default = Material::default();
        let (mut textures, mut mappings) = (default.textures, default.mappings);
        for (slot, info, name) in [
            (S::BaseColor, &pbr.base_color_texture, "pbrMetallicRoughness.baseColorTexture"),
            (
                S::MetallicRoughness,
                &pbr.metallic_roughness_texture,
                "pbrMetallicRoughness.metallicRoughnessTexture",
            ),
            (S::Normal, &material.normal_texture, "normalTexture"),
            (S::Occlusion, &material.occlusion_texture, "occlusionTexture"),
            (S::Emissive, &material.emissive_texture, "emissiveTexture"),
        ] {
            let Some(info) = info else { continue };
            let path = format!("{path}.{name}");
            get(&self.document.textures, info.index, "textures", &path)?;
            textures[slot as usize] = Some(info.index);
            mappings[slot as usize] = mapping(info, &path)?;
        }
        let extensions = &material.extensions;
        let strength = extension::<EmissiveStrength>(extensions, EMISSIVE_STRENGTH, path)?;
        let ior = extension::<Ior>(extensions, IOR, path)?;
        let transmission = extension::<Transmission>(extensions, TRANSMISSION, path)?;
        let (normal, occlusion) = (&material.normal_texture, &material.occlusion_texture);
        Ok(Material {
            name: material.name.clone().unwrap_or_default(),
            base_color: pbr.base_color_factor.unwrap_or(default.base_color),
            metallic: pbr.metallic_factor.unwrap_or(default.metallic),
            roughness: pbr.roughness_factor.unwrap_or(default.roughness),
            emissive: material.emissive_factor.unwrap_or(default.emissive),
            emissive_strength: strength
                .and_then(|one| one.emissive_strength)
                .unwrap_or(default.emissive_strength),
            normal_scale: normal.as_ref().and_then(|info| info.scale).unwrap_or(default.normal_scale),
            occlusion_strength: occlusion
                .as_ref()
                .and_then(|info| info.strength)
                .unwrap_or(default.occlusion_strength),
            alpha_cutoff: material.alpha_cutoff.unwrap_or(default.alpha_cutoff),
            alpha_mode: match material.alpha_mode {
                None | Some(AlphaMode::Opaque) => 0,
                Some(AlphaMode::Mask) => 1,
                Some(AlphaMode::Blend) => 2,
            },
            double_sided: material.double_sided,
            ior: ior.and_then(|one| one.ior).unwrap_or(default.ior),
            transmission: transmission
                .and_then(|one| one.transmission_factor)
                .unwrap_or(default.transmission),
            textures,
            mappings,
            ..default
        })
    }

    /// The textures of the file at a path. Only the images that they use are read, each once.
    pub(super) fn textures(&self, file: &Path) -> Result<Vec<Texture>> {
        let document = &self.document;
        let mut pictures: Vec<Option<PictureSource>> = vec![None; document.images.len()];
        let mut all = Vec::new();
        for (at, texture) in document.textures.iter().enumerate() {
            let path = format!("textures[{at}]");
            let picture = match texture.source {
                None => {
                    let names = list_of(texture.extensions.keys().map(String::as_str));
                    PictureSource::Missing(if names.is_empty() {
                        format!("`{path}` has no `source`")
                    } else {
                        format!("`{path}` has no `source` besides that of {names}, which is not read")
                    })
                }
                Some(image) => match get(&pictures, image, "images", &path)? {
                    Some(picture) => picture.clone(),
                    None => pictures[image].insert(self.picture(image, file)?).clone(),
                },
            };
            let sampler = match texture.sampler {
                None => sampler(&document::Sampler::default(), "")?,
                Some(at) => {
                    sampler(get(&document.samplers, at, "samplers", &path)?, &format!("samplers[{at}]"))?
                }
            };
            all.push(Texture { picture, sampler });
        }
        Ok(all)
    }

    fn picture(&self, at: usize, path: &Path) -> Result<PictureSource> {
        let (image, user) = (&self.document.images[at], format!("images[{at}]"));
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => match Uri::parse(uri) {
                Ok(Uri::Data(bytes)) => Ok(PictureSource::Bytes(bytes.into())),
                Ok(Uri::File(name)) => Ok(PictureSource::File(sibling(path, &name))),
                Err(error) if error.kind() == ErrorKind::UnsupportedFile => {
                    Ok(PictureSource::Missing(format!("`{user}.uri`: {}", error.message())))
                }
                Err(error) => Err(error.context(format!("`{user}.uri`"))),
            },
            (None, Some(view)) => {
                let bytes: Arc<[u8]> = self.view(view, &user)?.0.into();
                Ok(PictureSource::Bytes(bytes))
            }
            (None, None) => {
                Ok(PictureSource::Missing(format!("`{user}` has neither `uri` nor `bufferView`")))
            }
        }
    }
}

fn mapping(info: &TextureInfo, path: &str) -> Result<TextureMapping> {
    let transform = extension::<TextureTransform>(&info.extensions, TEXTURE_TRANSFORM, path)?;
    Ok(match transform {
        None => TextureMapping { texcoord: info.tex_coord, ..TextureMapping::default() },
        Some(TextureTransform { offset, rotation, scale, tex_coord }) => TextureMapping::new(
            tex_coord.unwrap_or(info.tex_coord),
            scale.unwrap_or([1.0; 2]),
            rotation.unwrap_or(0.0),
            offset.unwrap_or([0.0; 2]),
        ),
    })
}

/// Without filters glTF leaves them to the implementation: linear, as a scene's own.
fn sampler(sampler: &document::Sampler, path: &str) -> Result<Sampler> {
    use Filter::{Linear, Nearest};
    let unknown =
        |key: &str, number: u32| invalid(format!("`{path}.{key}` is {number}, which glTF does not define"));
    let (min_filter, mipmap_mode) = match sampler.min_filter {
        Some(9728) => (Nearest, None),
        Some(9729) => (Linear, None),
        Some(9984) => (Nearest, Some(Nearest)),
        Some(9985) => (Linear, Some(Nearest)),
        Some(9986) => (Nearest, Some(Linear)),
        Some(9987) | None => (Linear, Some(Linear)),
        Some(other) => return Err(unknown("minFilter", other)),
    };
    let mag_filter = match sampler.mag_filter {
        Some(9728) => Nearest,
        Some(9729) | None => Linear,
        Some(other) => return Err(unknown("magFilter", other)),
    };
    let mode = |key: &str, mode: Option<u32>| match mode {
        Some(33071) => Ok(AddressMode::ClampToEdge),
        Some(33648) => Ok(AddressMode::MirroredRepeat),
        Some(10497) | None => Ok(AddressMode::Repeat),
        Some(other) => Err(unknown(key, other)),
    };
    let default = Sampler::default();
    Ok(Sampler {
        mag_filter,
        min_filter,
        mipmap_mode: mipmap_mode.unwrap_or(Nearest),
        // Without mip levels the level is rounded to 0, and `minFilter` applies to what is minified
        // (Vulkan, `VkSamplerCreateInfo`: the filters of OpenGL).
        max_lod: if mipmap_mode.is_some() { default.max_lod } else { 0.25 },
        address_mode: [mode("wrapS", sampler.wrap_s)?, mode("wrapT", sampler.wrap_t)?, AddressMode::Repeat],
        ..default
    })
}
