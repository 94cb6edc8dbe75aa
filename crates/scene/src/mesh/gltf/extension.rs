//! Names of the extensions of glTF that are read.

pub(super) const DRACO: &str = "KHR_draco_mesh_compression";
pub(super) const EMISSIVE_STRENGTH: &str = "KHR_materials_emissive_strength";
/// Makes several instances of a node.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";
pub(super) const IOR: &str = "KHR_materials_ior";
/// Compress buffer views, which name a buffer without content for readers that do not decompress.
pub(super) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
pub(super) const QUANTIZATION: &str = "KHR_mesh_quantization";
pub(super) const TEXTURE_TRANSFORM: &str = "KHR_texture_transform";
pub(super) const TRANSMISSION: &str = "KHR_materials_transmission";
pub(super) const VISIBILITY: &str = "KHR_node_visibility";

/// The extensions that are read.
pub(super) const READ: [&str; 7] =
    [EMISSIVE_STRENGTH, INSTANCING, IOR, QUANTIZATION, TEXTURE_TRANSFORM, TRANSMISSION, VISIBILITY];

/// The extensions that compress. Only what is compressed is not read.
pub(super) const COMPRESSED: [&str; 3] = [DRACO, MESHOPT[0], MESHOPT[1]];
