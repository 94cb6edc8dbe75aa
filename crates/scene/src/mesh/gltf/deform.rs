//! Morph targets and skins: meshes whose vertices nodes move (glTF 2.0, 3.7.2.2 and 3.7.3).

use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3};

use crate::mesh::gltf::accessor::Expected;
use crate::mesh::gltf::document::{ComponentType, Primitive, Shape};
use crate::mesh::gltf::extension::QUANTIZATION;
use crate::mesh::gltf::{Data, get, invalid};
use crate::mesh::listed::Numbers;
use anyhit_base::error::Result;

/// The state in which a node shows a mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Pose {
    /// The weights of morph targets; those that follow are 0.
    pub weights: Vec<f32>,
    pub placement: Placement,
}

/// The transform of vertices before the instance's.
#[derive(Clone, Debug, Default)]
pub(super) enum Placement {
    #[default]
    None,
    /// That of a node whose transform cannot be inverted, as that of an instance must be.
    Flat(DMat4),
    /// The matrices of the joints of a skin.
    Skin(Arc<[DMat4]>),
}

impl Pose {
    fn is_rest(&self) -> bool {
        self.weights.is_empty() && matches!(self.placement, Placement::None)
    }
}

/// The types of attributes whose type is not fixed.
const ANY: Expected<'static> = Expected {
    shapes: &[Shape::Scalar, Shape::Vec2, Shape::Vec3, Shape::Vec4],
    components: &[
        ComponentType::I8,
        ComponentType::U8,
        ComponentType::I16,
        ComponentType::U16,
        ComponentType::U32,
        ComponentType::F32,
    ],
};

impl Data {
    /// The types of positions: with KHR_mesh_quantization also integers.
    pub(super) fn position_types(&self) -> Expected<'static> {
        use ComponentType as T;
        let document = &self.document;
        let mut extensions = document.extensions_used.iter().chain(&document.extensions_required);
        let components: &[T] = match extensions.any(|name| name == QUANTIZATION) {
            true => &[T::F32, T::I8, T::U8, T::I16, T::U16],
            false => &[T::F32],
        };
        Expected { shapes: &[Shape::Vec3], components }
    }

    /// The matrices that the joints of a skin, which `user` names, apply.
    pub(super) fn joint_matrices(&self, skin: usize, worlds: &[DMat4], user: &str) -> Result<Arc<[DMat4]>> {
        let path = format!("skins[{skin}]");
        let skin = get(&self.document.skins, skin, "skins", user)?;
        let bind = match skin.inverse_bind_matrices {
            None => Vec::new(),
            Some(accessor) => {
                let expected = Expected { shapes: &[Shape::Mat4], components: &[ComponentType::F32] };
                let user = format!("{path}.inverseBindMatrices");
                let values = self.elements(accessor, &expected, &user)?.numbers().values;
                let matrices = values.as_chunks::<16>().0.iter();
                let bind: Vec<_> = matrices.map(|m| DMat4::from_cols_array(&m.map(f64::from))).collect();
                if bind.len() < skin.joints.len() {
                    let (found, joints) = (bind.len(), skin.joints.len());
                    return Err(invalid(format!("`{user}` has {found} matrices for {joints} joints")));
                }
                bind
            }
        };
        let joint = |(at, node): (usize, &usize)| {
            let world = get(worlds, *node, "nodes", &format!("{path}.joints[{at}]"))?;
            Ok(*world * bind.get(at).copied().unwrap_or(DMat4::IDENTITY))
        };
        skin.joints.iter().enumerate().map(joint).collect()
    }

    /// The positions of a primitive in a pose.
    pub(super) fn positions(&self, primitive: &Primitive, pose: &Pose, path: &str) -> Result<Vec<[f32; 3]>> {
        match primitive.attributes.get("POSITION") {
            Some(accessor) if pose.is_rest() => {
                let user = format!("{path}.attributes.POSITION");
                Ok(self.elements(*accessor, &self.position_types(), &user)?.vertices())
            }
            _ => Ok(self.attribute(primitive, "POSITION", pose, path)?.values.as_chunks().0.to_vec()),
        }
    }

    /// The numbers of an attribute in a pose. `path` is that of the primitive.
    pub(super) fn attribute(
        &self,
        primitive: &Primitive,
        name: &str,
        pose: &Pose,
        path: &str,
    ) -> Result<Numbers> {
        let positions = self.position_types();
        let expected = if name == "POSITION" { &positions } else { &ANY };
        let vertices = self.vertex_count(primitive, path)?;
        let read = |attributes: &std::collections::BTreeMap<String, usize>, name: &str, path: &str| {
            let Some(accessor) = attributes.get(name) else { return Ok(None) };
            let user = format!("{path}.{name}");
            let expected = if name == "POSITION" { expected } else { &ANY };
            let elements = self.elements(*accessor, expected, &user)?;
            let count = elements.accessor.count;
            if count != vertices {
                return Err(invalid(format!("`{user}` has {count} elements for {vertices} vertices")));
            }
            Ok(Some(elements.numbers()))
        };
        let own = read(&primitive.attributes, name, &format!("{path}.attributes"))?;
        let mut own = own.ok_or_else(|| invalid(format!("`{path}.attributes` has no `{name}`")))?;
        let moves = matches!(name, "POSITION" | "NORMAL" | "TANGENT");
        if pose.is_rest() || !(moves || name.starts_with("TEXCOORD_") || name.starts_with("COLOR_")) {
            return Ok(own);
        }
        let components = own.components;
        let mut values: Vec<f64> = own.values.iter().copied().map(f64::from).collect();
        for (at, (target, weight)) in primitive.targets.iter().zip(&pose.weights).enumerate() {
            if *weight == 0.0 {
                continue;
            }
            let Some(change) = read(target, name, &format!("{path}.targets[{at}]"))? else { continue };
            let changes = change.values.chunks_exact(change.components);
            for (value, change) in values.chunks_exact_mut(components).zip(changes) {
                for (value, change) in value.iter_mut().zip(change) {
                    *value += f64::from(*weight) * f64::from(*change);
                }
            }
        }
        if name.starts_with("COLOR_") {
            values.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
        }
        if moves {
            if components < 3 {
                return Err(invalid(format!("`{path}.attributes.{name}` has fewer than 3 components")));
            }
            let matrices = self.vertex_matrices(primitive, pose, vertices, path)?;
            for (at, value) in values.chunks_exact_mut(components).enumerate() {
                let old = DVec3::from_slice(value);
                let new = transformed(name, old, &matrices(at));
                value[..3].copy_from_slice(&new.to_array());
            }
        }
        own.values.iter_mut().zip(&values).for_each(|(own, value)| *own = *value as f32);
        Ok(own)
    }

    /// The number of vertices of a primitive.
    pub(super) fn vertex_count(&self, primitive: &Primitive, path: &str) -> Result<usize> {
        let user = format!("{path}.attributes.POSITION");
        let accessor = primitive.attributes.get("POSITION");
        let accessor = accessor.ok_or_else(|| invalid(format!("`{user}` is missing")))?;
        Ok(get(&self.document.accessors, *accessor, "accessors", &user)?.count)
    }

    /// The matrix of each vertex: the mean of those of its joints by its weights.
    fn vertex_matrices(
        &self,
        primitive: &Primitive,
        pose: &Pose,
        vertices: usize,
        path: &str,
    ) -> Result<Box<dyn Fn(usize) -> DMat4>> {
        let matrices = match &pose.placement {
            Placement::None => return Ok(Box::new(|_| DMat4::IDENTITY)),
            Placement::Flat(transform) => {
                let transform = *transform;
                return Ok(Box::new(move |_| transform));
            }
            Placement::Skin(matrices) => matrices.clone(),
        };
        let rest = Pose::default();
        let mut sets = Vec::new();
        for set in 0.. {
            let (joints, weights) = (format!("JOINTS_{set}"), format!("WEIGHTS_{set}"));
            if !primitive.attributes.contains_key(&joints) || !primitive.attributes.contains_key(&weights) {
                break;
            }
            let four = |name: &str| {
                let numbers = self.attribute(primitive, name, &rest, path)?;
                match numbers.components {
                    4 => Ok(numbers.values),
                    other => {
                        Err(invalid(format!("`{path}.attributes.{name}` has {other} components, expected 4")))
                    }
                }
            };
            let (joints, weights) = (four(&joints)?, four(&weights)?);
            if let Some(joint) = joints.iter().find(|joint| **joint as usize >= matrices.len()) {
                let count = matrices.len();
                return Err(invalid(format!(
                    "joint {joint} of `{path}.attributes.JOINTS_{set}` is out of range: the skin has {count}"
                )));
            }
            sets.push((joints, weights));
        }
        debug_assert!(sets.iter().all(|(joints, _)| joints.len() == 4 * vertices));
        Ok(Box::new(move |vertex| {
            let (mut mean, mut sum) = (DMat4::ZERO, 0.0);
            for (joints, weights) in &sets {
                for (joint, weight) in joints[4 * vertex..][..4].iter().zip(&weights[4 * vertex..][..4]) {
                    mean += matrices[*joint as usize] * f64::from(*weight);
                    sum += f64::from(*weight);
                }
            }
            // Without any weight the first joint moves the vertex.
            if sum == 0.0 { matrices[sets[0].0[4 * vertex] as usize] } else { mean * (1.0 / sum) }
        }))
    }
}

/// A position, or the unit vector of a normal or a tangent, behind a transform.
fn transformed(name: &str, vector: DVec3, transform: &DMat4) -> DVec3 {
    let linear = DMat3::from_mat4(*transform);
    match name {
        "POSITION" => transform.transform_point3(vector),
        "NORMAL" => {
            // The matrix of cofactors: the inverse transpose times the determinant, whose sign is
            // that of a mirror image.
            let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
            let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
            let sign = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
            (cofactors * vector * sign).normalize_or(vector)
        }
        _ => (linear * vector).normalize_or(vector),
    }
}
