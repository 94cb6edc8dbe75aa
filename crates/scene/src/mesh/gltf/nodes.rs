//! The nodes of a glTF file: transforms, cameras and the meshes that they place.

use glam::{DMat3, DMat4, DQuat, DVec3, DVec4, Vec3};

use crate::mesh::gltf::accessor::Expected;
use crate::mesh::gltf::document::{Camera, ComponentType, Node, Shape};
use crate::mesh::gltf::extension::{INSTANCING, VISIBILITY};
use crate::mesh::gltf::{Data, get, invalid};
use crate::mesh::material::{FileCamera, Projection};
use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::input::InputLimit;

/// How deep nodes may be nested.
const MAX_DEPTH: usize = 256;

/// A node that places a mesh.
pub(super) struct Placed {
    pub node: usize,
    pub mesh: usize,
    /// Object to world.
    pub world: DMat4,
}

/// The state that nodes have from their parents.
struct Inherited {
    world: DMat4,
    /// The product of all rotations, without scales.
    turn: DQuat,
    visible: bool,
    depth: usize,
}

/// A walk through the nodes of a scene.
pub(super) struct Walk<'a> {
    data: &'a Data,
    visited: u64,
    pub placed: Vec<Placed>,
    pub cameras: Vec<FileCamera>,
    /// The number of nodes with a mesh that are hidden.
    pub hidden: usize,
}

impl<'a> Walk<'a> {
    /// Walks through the default scene of a file, or its first one.
    pub(super) fn new(data: &'a Data) -> Result<Self> {
        let mut walk = Self { data, visited: 0, placed: Vec::new(), cameras: Vec::new(), hidden: 0 };
        let scenes = &data.document.scenes;
        let scene = match data.document.scene {
            Some(scene) => Some((scene, get(scenes, scene, "scenes", "scene")?)),
            None => scenes.first().map(|scene| (0, scene)),
        };
        if let Some((at, scene)) = scene {
            let path = format!("scenes[{at}].nodes");
            let root = Inherited { world: DMat4::IDENTITY, turn: DQuat::IDENTITY, visible: true, depth: 0 };
            scene.nodes.iter().try_for_each(|node| walk.node(*node, &path, &root))?;
        }
        Ok(walk)
    }

    fn node(&mut self, at: usize, user: &str, parent: &Inherited) -> Result<()> {
        if parent.depth > MAX_DEPTH {
            return Err(invalid(format!("nodes are nested more than {MAX_DEPTH} deep, possibly in a cycle")));
        }
        // Two nodes that list a third twice, and so on, double each time.
        self.visit()?;
        let document = &self.data.document;
        let node = get(&document.nodes, at, "nodes", user)?;
        let path = format!("nodes[{at}]");
        let own = local(node);
        let (world, turn) = (parent.world * own, parent.turn * rotation(node, &own));
        let visibility = node.extensions.get(VISIBILITY);
        let visible = parent.visible && visibility.is_none_or(|one| one["visible"] != false);
        if let Some(camera) = node.camera {
            let camera_path = format!("cameras[{camera}]");
            let camera = get(&document.cameras, camera, "cameras", &path)?;
            let name = node.name.clone().or_else(|| camera.name.clone()).unwrap_or_default();
            let projection = projection(camera, &camera_path)?;
            self.cameras.push(FileCamera {
                name,
                path: camera_path,
                world: unmirrored(&world, turn),
                projection,
            });
        }
        if let Some(mesh) = node.mesh {
            get(&document.meshes, mesh, "meshes", &path)?;
            // glTF 2.0, 3.5.2: a scale of zero hides a node; a skin ignores the node's transform.
            let is_point = DMat3::from_mat4(world) == DMat3::ZERO && node.skin.is_none();
            if !visible || is_point {
                self.hidden += 1;
            } else {
                for own in self.data.instances(node, &path)? {
                    self.visit()?;
                    self.placed.push(Placed { node: at, mesh, world: world * own });
                }
            }
        }
        let path = format!("{path}.children");
        let own = Inherited { world, turn, visible, depth: parent.depth + 1 };
        node.children.iter().try_for_each(|child| self.node(*child, &path, &own))
    }

    fn visit(&mut self) -> Result<()> {
        self.visited += 1;
        self.data.limits.check(InputLimit::MeshNodes, self.visited, ErrorKind::InvalidMesh)
    }
}

/// The transform of a node in its parent.
fn local(node: &Node) -> DMat4 {
    match &node.matrix {
        Some(matrix) => DMat4::from_cols_array(&matrix.map(f64::from)),
        None => compose(
            node.translation.unwrap_or([0.0; 3]),
            node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]),
            node.scale.unwrap_or([1.0; 3]),
        ),
    }
}

/// The rotation of a node.
fn rotation(node: &Node, local: &DMat4) -> DQuat {
    match (&node.matrix, node.rotation) {
        (Some(_), _) => local.to_scale_rotation_translation().1,
        (None, Some(rotation)) => DQuat::from_array(rotation.map(f64::from)),
        (None, None) => DQuat::IDENTITY,
    }
}

/// A transform whose axes point to the side of those of a rotation; a negative scale mirrors
/// others.
fn unmirrored(world: &DMat4, turn: DQuat) -> DMat4 {
    let axis =
        |column: DVec4, own: DVec3| if column.truncate().dot(turn * own) < 0.0 { -column } else { column };
    let [x, y, z] =
        [axis(world.x_axis, DVec3::X), axis(world.y_axis, DVec3::Y), axis(world.z_axis, DVec3::Z)];
    DMat4::from_cols(x, y, z, world.w_axis)
}

fn compose(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> DMat4 {
    DMat4::from_scale_rotation_translation(
        Vec3::from(scale).as_dvec3(),
        DQuat::from_array(rotation.map(f64::from)),
        Vec3::from(translation).as_dvec3(),
    )
}

/// Returns true if a transform maps all of space to a plane, a line or a point, but for rounding.
pub(super) fn is_flat(transform: &DMat4) -> bool {
    let linear = DMat3::from_mat4(*transform);
    let volume: f64 = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length).iter().product();
    linear.determinant().abs() <= volume * 2f64.powi(-40)
}

impl Data {
    /// The transforms of the instances of a node (EXT_mesh_gpu_instancing), the identity without
    /// that extension.
    fn instances(&self, node: &Node, path: &str) -> Result<Vec<DMat4>> {
        use {ComponentType as T, Shape as S};
        let Some(extension) = node.extensions.get(INSTANCING) else { return Ok(vec![DMat4::IDENTITY]) };
        let path = format!("{path}.extensions.{INSTANCING}.attributes");
        let attribute = |name: &str, shape: Shape, components: &[ComponentType]| {
            let Some(accessor) = extension["attributes"][name].as_u64() else { return Ok(None) };
            let expected = Expected { shapes: &[shape], components };
            let elements = self.elements(accessor as usize, &expected, &format!("{path}.{name}"))?;
            Ok(Some(elements.numbers().values))
        };
        let translations = attribute("TRANSLATION", S::Vec3, &[T::F32])?;
        let rotations = attribute("ROTATION", S::Vec4, &[T::F32, T::I8, T::I16])?;
        let scales = attribute("SCALE", S::Vec3, &[T::F32])?;
        let counts = [(&translations, 3), (&rotations, 4), (&scales, 3)]
            .map(|(values, components)| values.as_ref().map(|values| values.len() / components));
        let count = counts.iter().flatten().copied().max().unwrap_or(0);
        if counts.iter().flatten().any(|own| *own != count) {
            return Err(invalid(format!("the attributes of `{path}` have different numbers of elements")));
        }
        self.limits.check(InputLimit::MeshNodes, count as u64, ErrorKind::InvalidMesh)?;
        Ok((0..count)
            .map(|at| {
                compose(
                    element(translations.as_deref(), at).unwrap_or([0.0; 3]),
                    element(rotations.as_deref(), at).unwrap_or([0.0, 0.0, 0.0, 1.0]),
                    element(scales.as_deref(), at).unwrap_or([1.0; 3]),
                )
            })
            .collect())
    }

    /// The transform of each node to the world, along its parents.
    pub(super) fn worlds(&self) -> Vec<DMat4> {
        let nodes = &self.document.nodes;
        let mut parents = vec![None; nodes.len()];
        for (at, node) in nodes.iter().enumerate() {
            for child in &node.children {
                if let Some(parent @ None) = parents.get_mut(*child) {
                    *parent = Some(at);
                }
            }
        }
        let world = |at: usize| {
            let (mut world, mut next) = (local(&nodes[at]), parents[at]);
            for _ in 0..MAX_DEPTH {
                let Some(parent) = next else { break };
                world = local(&nodes[parent]) * world;
                next = parents[parent];
            }
            world
        };
        (0..nodes.len()).map(world).collect()
    }
}

fn element<const N: usize>(values: Option<&[f32]>, at: usize) -> Option<[f32; N]> {
    values.and_then(|values| values.as_chunks().0.get(at)).copied()
}

fn projection(camera: &Camera, path: &str) -> Result<Projection> {
    let missing = || invalid(format!("`{path}` has the type `{}` without its properties", camera.kind));
    match camera.kind.as_str() {
        "perspective" => {
            let lens = camera.perspective.as_ref().ok_or_else(missing)?;
            Ok(Projection::Perspective {
                // tan(x / 2) of an angle in radians, which the crate of correctly rounded functions
                // gives in f32: the same on every machine.
                slope: f64::from(pxfm::f_tanf(lens.yfov / 2.0)),
                aspect: lens.aspect_ratio.map(f64::from),
                near: lens.znear.into(),
                far: lens.zfar.map_or(f64::INFINITY, f64::from),
            })
        }
        "orthographic" => {
            let lens = camera.orthographic.as_ref().ok_or_else(missing)?;
            Ok(Projection::Orthographic {
                half: [lens.xmag.into(), lens.ymag.into()],
                near: lens.znear.into(),
                far: lens.zfar.into(),
            })
        }
        other => {
            Err(invalid(format!("`{path}.type` is `{other}`, expected `perspective` or `orthographic`")))
        }
    }
}
