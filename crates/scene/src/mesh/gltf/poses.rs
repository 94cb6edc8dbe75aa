//! The meshes of a glTF file in the poses in which nodes show them.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DMat4;

use crate::mesh::gltf::Data;
use crate::mesh::gltf::deform::{Placement, Pose};
use crate::mesh::gltf::document::{Node, Primitive};
use crate::mesh::gltf::nodes::{Placed, is_flat};
use crate::mesh::gltf::unread::{Ignored, Skipped};
use crate::mesh::listed::ModelNode;
use anyhit_base::error::Result;

/// A mesh in a pose.
#[derive(Debug)]
pub(super) struct PosedMesh {
    pub mesh: usize,
    pub name: Option<String>,
    pub pose: Pose,
    /// Its primitives of triangles.
    pub primitives: Vec<usize>,
}

/// A mesh, the bits of its weights and of a transform of its vertices, and a skin.
type PoseKey = (usize, Vec<u32>, Vec<u64>, Option<usize>);

/// The poses of meshes found so far. The first pose of a mesh is in its place in the file; others
/// follow all meshes.
pub(super) struct Poses<'a> {
    data: &'a Data,
    meshes: Vec<PosedMesh>,
    known: HashMap<PoseKey, usize>,
    /// Whether a node shows each mesh of the file.
    is_placed: Vec<bool>,
    /// The transforms of nodes, if there is a skin.
    worlds: Option<Vec<DMat4>>,
    skins: HashMap<usize, Arc<[DMat4]>>,
}

impl<'a> Poses<'a> {
    /// The meshes in all poses, and the nodes that show them.
    ///
    /// # Errors
    /// `InvalidMesh` for a skin that cannot be read.
    pub(super) fn of(
        data: &'a Data,
        placed: Vec<Placed>,
        ignored: &mut Ignored,
    ) -> Result<(Vec<PosedMesh>, Vec<ModelNode>)> {
        let count = data.document.meshes.len();
        let mut poses = Self {
            data,
            meshes: Vec::new(),
            known: HashMap::new(),
            is_placed: vec![false; count],
            worlds: None,
            skins: HashMap::new(),
        };
        for at in 0..count {
            let mesh = &data.document.meshes[at];
            let weights = data.weights(at, &mesh.weights);
            poses.push(at, mesh.name.clone(), Pose { weights, placement: Placement::None });
        }
        let node = |placed| poses.node(placed, ignored);
        let nodes = placed.into_iter().map(node).collect::<Result<_>>()?;
        Ok((poses.meshes, nodes))
    }

    fn push(&mut self, mesh: usize, name: Option<String>, pose: Pose) {
        let primitives = self.data.document.meshes[mesh].primitives.iter().enumerate();
        let primitives = primitives.filter(|(_, one)| Skipped::of(one).is_none()).map(|(at, _)| at);
        self.meshes.push(PosedMesh { mesh, name, pose, primitives: primitives.collect() });
    }

    fn node(&mut self, placed: Placed, ignored: &mut Ignored) -> Result<ModelNode> {
        let Placed { node: at, mesh, world } = placed;
        let document = &self.data.document;
        let (node, own) = (&document.nodes[at], &document.meshes[mesh]);
        let weights = self.data.weights(mesh, node.weights.as_ref().unwrap_or(&own.weights));
        let has_joints = |primitive: &Primitive| {
            Skipped::of(primitive).is_some()
                || ["JOINTS_0", "WEIGHTS_0"].iter().all(|name| primitive.attributes.contains_key(*name))
        };
        let skin = node.skin.filter(|_| own.primitives.iter().all(has_joints));
        ignored.skins += usize::from(skin != node.skin);
        let flat = skin.is_none() && is_flat(&world);
        let transform = if flat { world.to_cols_array().map(f64::to_bits).to_vec() } else { Vec::new() };
        let bits = weights.iter().map(|weight| weight.to_bits()).collect();
        let key = (mesh, bits, transform, skin);
        let listed = match self.known.get(&key) {
            Some(listed) => *listed,
            None => {
                let placement = match skin {
                    Some(skin) => Placement::Skin(self.skin(skin, at)?),
                    None if flat => Placement::Flat(world),
                    None => Placement::None,
                };
                let listed = self.add(mesh, Pose { weights, placement }, at, node);
                self.known.insert(key, listed);
                listed
            }
        };
        let world = if flat || skin.is_some() { DMat4::IDENTITY } else { world };
        Ok(ModelNode { name: node.name.clone(), mesh: listed, world })
    }

    /// Adds a pose. A second one of a mesh has the name of its node behind that of the mesh.
    fn add(&mut self, mesh: usize, pose: Pose, at: usize, node: &Node) -> usize {
        if !std::mem::replace(&mut self.is_placed[mesh], true) {
            self.meshes[mesh].pose = pose;
            return mesh;
        }
        let own = self.data.document.meshes[mesh].name.as_deref().unwrap_or("mesh");
        let of = node.name.clone().unwrap_or_else(|| format!("node#{at}"));
        self.push(mesh, Some(format!("{own}@{of}")), pose);
        self.meshes.len() - 1
    }

    /// The matrices of the joints of a skin that a node has.
    fn skin(&mut self, skin: usize, node: usize) -> Result<Arc<[DMat4]>> {
        if let Some(known) = self.skins.get(&skin) {
            return Ok(known.clone());
        }
        let worlds = self.worlds.get_or_insert_with(|| self.data.worlds());
        let matrices = self.data.joint_matrices(skin, worlds, &format!("nodes[{node}]"))?;
        self.skins.insert(skin, matrices.clone());
        Ok(matrices)
    }
}
