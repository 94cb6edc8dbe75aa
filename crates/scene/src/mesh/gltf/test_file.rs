//! Small glTF files for tests.

use std::path::Path;

use serde_json::{Value, json};

use crate::files::EmbeddedFiles;
use crate::mesh::listed::AnimationTime;
use crate::mesh::model::{MeshFormat, Model};
use anyhit_base::error::Result;

/// A document whose accessors share one buffer.
pub(super) struct TestFile {
    pub document: Value,
    pub bytes: Vec<u8>,
}

impl TestFile {
    /// A node with a mesh of one triangle, whose positions, accessor 0, are (0, 0, 0), (1, 0, 0)
    /// and (0, 1, 0).
    pub(super) fn triangle() -> Self {
        let document = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
            "buffers": [{ "uri": "a.bin" }], "bufferViews": [], "accessors": []
        });
        let mut file = Self { document, bytes: Vec::new() };
        file.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        file
    }

    /// Adds an accessor and returns its index.
    pub(super) fn add(&mut self, component: u32, shape: &str, count: usize, bytes: &[u8]) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        let views = self.document["bufferViews"].as_array_mut().unwrap();
        views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        let view = views.len() - 1;
        let accessors = self.document["accessors"].as_array_mut().unwrap();
        let accessor =
            json!({ "bufferView": view, "componentType": component, "type": shape, "count": count });
        accessors.push(accessor);
        accessors.len() - 1
    }

    /// Adds an accessor of floats and returns its index.
    pub(super) fn floats(&mut self, shape: &str, values: &[f32]) -> usize {
        let components = match shape {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.add(5126, shape, values.len() / components, &bytes)
    }

    pub(super) fn open(&self) -> Result<Model> {
        self.open_at(None)
    }

    pub(super) fn open_at(&self, time: Option<&AnimationTime>) -> Result<Model> {
        let mut document = self.document.clone();
        document["buffers"][0]["byteLength"] = self.bytes.len().into();
        let files = EmbeddedFiles(&[("dir/a.bin", &self.bytes[..])]);
        let text = document.to_string().into_bytes();
        Model::open_at(MeshFormat::Gltf, Path::new("dir/m.gltf"), text, &files, time)
    }

    /// The message of a file that is not read, with its notes.
    pub(super) fn mistake(&self) -> String {
        match self.open() {
            Ok(_) => panic!("the file is read"),
            Err(error) => error.render(),
        }
    }
}

/// The positions of the vertices of a part.
pub(super) fn vertices(model: &Model, part: usize) -> Vec<[f32; 3]> {
    model.triangles(part).unwrap().vertices
}
