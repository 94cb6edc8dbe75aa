//! Cameras as the matrices that shaders take: first of all the two inverse ones that ray-generation
//! shaders usually have.
//!
//! View space is right-handed and looks along -z with y up. Clip space is Vulkan's: y points down,
//! depth goes from 0 at the near plane to 1 at the far plane. A ray-generation shader gets a ray by
//! ```glsl
//! vec2 d = 2.0 * (vec2(gl_LaunchIDEXT.xy) + 0.5) / vec2(gl_LaunchSizeEXT.xy) - 1.0;
//! vec3 origin = view_inverse[3].xyz;
//! vec3 direction = mat3(view_inverse) * normalize((projection_inverse * vec4(d, 1, 1)).xyz);
//! ```

use glam::{DMat4, DVec4};

use crate::data_sources::DataSources;
use crate::mesh::material::Projection;
use crate::read::{Named, OneOrMore, Parse, Span, Spanned, Table, TomlValue};
use crate::transform_entry::{matrix_of, parse_transform};
use anyhit_base::error::Result;
use anyhit_base::error::names::list_of;
use anyhit_engine::math::array;

/// A camera as a scene writes it: by its numbers, or one of a mesh file.
#[derive(Clone, Debug)]
pub enum CameraEntry {
    /// By its numbers.
    LookAt(Camera),
    /// One of a mesh file.
    File(Box<FileCameraEntry>),
}

/// A camera of a mesh file.
#[derive(Clone, Debug)]
pub struct FileCameraEntry {
    /// The file.
    pub file: Spanned<String>,
    /// Its name; without one the file has a single camera.
    pub name: Option<Spanned<String>>,
    /// Comes after the transform of the camera's node.
    pub transform: Option<[[f32; 4]; 3]>,
    /// The distance of the far plane, instead of the file's.
    pub far: Option<f32>,
    /// Width divided by height, instead of the file's.
    pub aspect: Option<f32>,
}

impl Parse for CameraEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        if !table.has("file") {
            return Camera::parse(value).map(Self::LookAt);
        }
        let entry = FileCameraEntry {
            file: table.required("file")?,
            name: table.optional("name"),
            transform: parse_transform(&table),
            far: table.optional("far"),
            aspect: table.optional("aspect"),
        };
        table.finish();
        Some(Self::File(Box::new(entry)))
    }
}

impl CameraEntry {
    /// The matrices of the camera.
    ///
    /// # Errors
    /// Says what is wrong with the camera or its file.
    pub fn view(&self, span: &Span, sources: &DataSources<'_>) -> Result<CameraView> {
        match self {
            Self::LookAt(camera) => camera.view(sources.aspect).map_err(|message| span.error(message)),
            Self::File(entry) => entry.view(sources),
        }
    }
}

impl FileCameraEntry {
    fn view(&self, sources: &DataSources<'_>) -> Result<CameraView> {
        let model = sources.models.open(&self.file, None, sources.files)?;
        let names = || list_of(model.cameras.iter().map(|camera| camera.name.as_str()));
        let found = match (&self.name, &model.cameras[..]) {
            (Some(name), cameras) => {
                let found = cameras.iter().find(|camera| camera.name == name.value);
                found.ok_or_else(|| name.span.error(format!("the file has no camera `{}`", name.value)))
            }
            (None, [camera]) => Ok(camera),
            (None, []) => Err(self.file.span.error("the file has no camera")),
            (None, several) => {
                let message = format!("the file has {} cameras: select one with `name`", several.len());
                Err(self.file.span.error(message))
            }
        };
        let camera = found.map_err(|error| match model.cameras.is_empty() {
            true => error,
            false => error.note(format!("cameras in the file: {}", names())),
        })?;
        let own = self.transform.map_or(DMat4::IDENTITY, |rows| matrix_of(&rows));
        let world = own * camera.world;
        let view_inverse = without_scale(world)
            .ok_or_else(|| self.file.span.error("the camera's node has a scale of zero"))?;
        let mut projection = camera.projection;
        let (Projection::Perspective { far, .. } | Projection::Orthographic { far, .. }) = &mut projection;
        *far = self.far.map_or(*far, f64::from);
        if let Projection::Perspective { aspect: given, .. } = &mut projection {
            *given = self.aspect.map(f64::from).or(*given);
        }
        let view = CameraView::new(view_inverse, &projection, f64::from(sources.aspect));
        view.map_err(|message| {
            let error = self.file.span.error(format!("`{}` of the file: {message}", camera.path));
            error.note("help: correct the camera in the file, where `yfov` is in radians")
        })
    }
}

/// A transform without scale, mirroring and shear, which do not count for cameras (glTF 2.0,
/// 3.10.2): it keeps the direction of the z axis, and the plane of the y and z axes; `None` if
/// these are flat.
fn without_scale(world: DMat4) -> Option<DMat4> {
    let [up, back] = [world.y_axis, world.z_axis].map(DVec4::truncate);
    let z = back.try_normalize()?;
    // Twice, as the first result has the rounding errors of a vector that may be much longer.
    let y = up.try_normalize()?.reject_from_normalized(z).try_normalize()?;
    let y = y.reject_from_normalized(z).try_normalize()?;
    let has_x = world.x_axis.truncate().try_normalize().is_some();
    let axes = [y.cross(z), y, z].map(|axis| axis.extend(0.0));
    has_x.then(|| DMat4::from_cols(axes[0], axes[1], axes[2], world.w_axis))
}

/// The matrices of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// World to view.
    pub view: DMat4,
    /// View to world.
    pub view_inverse: DMat4,
    /// View to clip.
    pub projection: DMat4,
    /// Clip to view.
    pub projection_inverse: DMat4,
}

impl CameraView {
    fn new(view_inverse: DMat4, projection: &Projection, aspect: f64) -> Result<Self, String> {
        let (projection, projection_inverse) = match *projection {
            Projection::Perspective { slope, aspect: own, near, far } => {
                let aspect = own.unwrap_or(aspect);
                // The slope of half the angle is not positive from half a turn on.
                if !(slope > 0.0 && slope.is_finite()) {
                    return Err("the vertical angle of view is not between 0 and 180 degrees".to_string());
                }
                check_planes(near, far)?;
                if !(aspect > 0.0 && aspect.is_finite()) {
                    return Err(format!("the aspect ratio {aspect} is not a positive number"));
                }
                // By 1 / far, which is 0 for a plane that is infinitely far.
                let depth = 1.0 / (near / far - 1.0);
                let forward = DMat4::from_cols_array_2d(&[
                    [1.0 / (slope * aspect), 0.0, 0.0, 0.0],
                    [0.0, -1.0 / slope, 0.0, 0.0],
                    [0.0, 0.0, depth, -1.0],
                    [0.0, 0.0, near * depth, 0.0],
                ]);
                let back = DMat4::from_cols_array_2d(&[
                    [slope * aspect, 0.0, 0.0, 0.0],
                    [0.0, -slope, 0.0, 0.0],
                    [0.0, 0.0, 0.0, 1.0 / far - 1.0 / near],
                    [0.0, 0.0, -1.0, 1.0 / near],
                ]);
                (forward, back)
            }
            Projection::Orthographic { half: [width, height], near, far } => {
                if width == 0.0 || height == 0.0 || !(far - near).is_finite() || far <= near {
                    return Err("the view volume of the orthographic camera is empty".to_string());
                }
                let depth = far - near;
                let forward = DMat4::from_cols_array_2d(&[
                    [1.0 / width, 0.0, 0.0, 0.0],
                    [0.0, -1.0 / height, 0.0, 0.0],
                    [0.0, 0.0, -1.0 / depth, 0.0],
                    [0.0, 0.0, -near / depth, 1.0],
                ]);
                let back = DMat4::from_cols_array_2d(&[
                    [width, 0.0, 0.0, 0.0],
                    [0.0, -height, 0.0, 0.0],
                    [0.0, 0.0, -depth, 0.0],
                    [0.0, 0.0, -near, 1.0],
                ]);
                (forward, back)
            }
        };
        // The axes are orthonormal, but of a file not exactly.
        let view = view_inverse.inverse();
        if !view.is_finite() || !view_inverse.is_finite() {
            return Err("camera values must be finite".to_string());
        }
        Ok(Self { view, view_inverse, projection, projection_inverse })
    }

    /// One of the matrices, rounded once.
    pub fn matrix(&self, name: CameraMatrix) -> DMat4 {
        match name {
            CameraMatrix::View => self.view,
            CameraMatrix::ViewInverse => self.view_inverse,
            CameraMatrix::Projection => self.projection,
            CameraMatrix::ProjectionInverse => self.projection_inverse,
            CameraMatrix::ViewProjection => self.projection * self.view,
            CameraMatrix::ViewProjectionInverse => self.view_inverse * self.projection_inverse,
        }
    }
}

fn check_planes(near: f64, far: f64) -> Result<(), String> {
    match near > 0.0 && far > near {
        true => Ok(()),
        false => Err(format!("the planes {near} and {far} do not satisfy 0 < near < far")),
    }
}

/// A matrix of a camera; columns are multiplied from the right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraMatrix {
    /// World to view.
    View,
    /// View to world.
    ViewInverse,
    /// View to clip.
    Projection,
    /// Clip to view.
    ProjectionInverse,
    /// World to clip.
    ViewProjection,
    /// Clip to world.
    ViewProjectionInverse,
}

impl Named for CameraMatrix {
    const WHAT: &'static str = "matrix of a camera";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("view", Self::View),
        ("view_inverse", Self::ViewInverse),
        ("projection", Self::Projection),
        ("projection_inverse", Self::ProjectionInverse),
        ("view_projection", Self::ViewProjection),
        ("view_projection_inverse", Self::ViewProjectionInverse),
    ];
}

/// The order of a matrix in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MatrixOrder {
    Column,
    Row,
}

impl Named for MatrixOrder {
    const WHAT: &'static str = "order of a matrix";
    const NAMES: &'static [(&'static str, Self)] =
        &[("column_major", Self::Column), ("row_major", Self::Row)];
}

/// Matrices of a camera, as a piece of data.
#[derive(Clone, Debug)]
pub struct CameraPiece {
    camera: CameraEntry,
    matrices: Vec<CameraMatrix>,
    /// Whether rows follow each other in memory, of the matrices as they are or transposed.
    rows: bool,
}

impl CameraPiece {
    /// Reads the keys of a piece that is made of matrices; `None` where it has none of them.
    pub fn parse(table: &Table<'_>) -> Option<Self> {
        let mut found = Vec::new();
        if let Some(camera) = table.optional::<CameraEntry>("camera") {
            let both = vec![CameraMatrix::ViewInverse, CameraMatrix::ProjectionInverse];
            found.push((camera, both));
        }
        for (key, matrix) in CameraMatrix::NAMES {
            found.extend(table.optional::<CameraEntry>(key).map(|camera| (camera, vec![*matrix])));
        }
        let [(camera, mut matrices)] = <[_; 1]>::try_from(found).ok().or_else(|| several(table))?;
        if table.has("camera") {
            matrices = table.or("matrices", OneOrMore(matrices)).0;
        }
        let transposed = table.or("transposed", false);
        let rows = table.or("order", MatrixOrder::Column) == MatrixOrder::Row;
        Some(Self { camera, matrices, rows: rows != transposed })
    }

    /// Its bytes.
    ///
    /// # Errors
    /// As [`CameraEntry::view`].
    pub fn encode(&self, span: &Span, sources: &DataSources<'_>) -> Result<Vec<u8>> {
        let view = self.camera.view(span, sources)?;
        let mut bytes = Vec::with_capacity(64 * self.matrices.len());
        for name in &self.matrices {
            let matrix = view.matrix(*name);
            let matrix = if self.rows { matrix.transpose() } else { matrix };
            let numbers = matrix.to_cols_array();
            bytes.extend(numbers.iter().flat_map(|x| (*x as f32).to_le_bytes()));
        }
        Ok(bytes)
    }
}

/// Reports several cameras in one piece; always `None`.
fn several<T>(table: &Table<'_>) -> Option<T> {
    let keys = CameraMatrix::NAMES.iter().map(|(key, _)| *key).chain(["camera"]);
    if keys.filter(|key| table.has(key)).count() > 1 {
        let message = "several matrices in one piece: list them as `{ camera = {...}, matrices = [...] }`";
        table.report().push(table.span().error(message));
    }
    None
}

/// A camera as a scene writes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its position.
    pub eye: [f32; 3],
    /// The point that it looks at.
    pub look_at: [f32; 3],
    /// The upward direction.
    pub up: [f32; 3],
    /// The vertical angle of view, in degrees.
    pub fov: f32,
    /// The distance of the near plane.
    pub near: f32,
    /// The distance of the far plane.
    pub far: f32,
    /// Width divided by height; the launch's if `None`.
    pub aspect: Option<f32>,
}

impl Parse for Camera {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let eye = table.required("eye");
        let look_at = table.required("look_at");
        let up = table.or("up", [0.0, 1.0, 0.0]);
        let fov = table.or("fov", 45.0);
        let near = table.or("near", 0.1);
        let far = table.or("far", 1000.0);
        let aspect = table.optional("aspect");
        table.finish();
        Some(Self { eye: eye?, look_at: look_at?, up, fov, near, far, aspect })
    }
}

impl Camera {
    /// The matrices of the camera; without an `aspect` of its own it has the given one.
    ///
    /// # Errors
    /// Says what is wrong with the camera.
    pub fn view(&self, aspect: f32) -> Result<CameraView, String> {
        let aspect = self.aspect.unwrap_or(aspect);
        let numbers = [self.eye, self.look_at, self.up].concat();
        if !numbers.iter().chain([&self.near, &self.far, &aspect]).all(|x| x.is_finite()) {
            return Err("camera values must be finite".into());
        }
        if !(self.fov > 0.0 && self.fov < 180.0) {
            return Err(format!("the field of view {} is not between 0 and 180 degrees", self.fov));
        }
        check_planes(self.near.into(), self.far.into())?;
        if aspect <= 0.0 {
            return Err(format!("the aspect ratio {aspect} is not positive"));
        }
        let back = normalized(sub(self.eye, self.look_at)).ok_or("`eye` and `look_at` are the same point")?;
        let right = normalized(cross(self.up.map(f64::from), back))
            .ok_or("`up` is zero or parallel to the line of sight")?;
        let up = cross(back, right);
        // tan(fov / 2), correctly rounded in f32 so that every machine makes the same picture.
        let slope = f64::from(pxfm::f_tanpif(self.fov / 360.0));
        let [x, y, z] = [right, up, back].map(|axis| DVec4::new(axis[0], axis[1], axis[2], 0.0));
        let eye = glam::Vec3::from(self.eye).as_dvec3().extend(1.0);
        let (near, far) = (self.near.into(), self.far.into());
        let projection = Projection::Perspective { slope, aspect: Some(aspect.into()), near, far };
        CameraView::new(DMat4::from_cols(x, y, z, eye), &projection, aspect.into())
    }
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f64; 3] {
    array::from_fn(|i| f64::from(a[i]) - f64::from(b[i]))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn normalized(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
    (length > 0.0).then(|| a.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `view_inverse`, then `projection_inverse`, both column-major.
    fn matrices(camera: &Camera, aspect: f32) -> [f32; 32] {
        let view = camera.view(aspect).unwrap();
        let both = [view.view_inverse, view.projection_inverse].map(|matrix| matrix.to_cols_array());
        array::from_fn(|i| both[i / 16][i % 16] as f32)
    }

    fn camera() -> Camera {
        Camera {
            eye: [1.0, 2.0, 3.0],
            look_at: [1.0, 2.0, -5.0],
            up: [0.0, 7.0, 0.0],
            fov: 90.0,
            near: 0.5,
            far: 8.0,
            aspect: None,
        }
    }

    #[test]
    fn matrices_by_hand() {
        let m = matrices(&camera(), 2.0);
        // Looks along -z from (1, 2, 3): the axes are the world's, the last column is the eye.
        assert_eq!(m[..16], [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 1., 2., 3., 1.]);
        // tan 45 degrees = 1; 1/8 - 1/0.5 = -1.875; 1/0.5 = 2. Column-major.
        assert_eq!(m[16..], [2., 0., 0., 0., 0., -1., 0., 0., 0., 0., 0., -1.875, 0., 0., -1., 2.]);
    }

    /// The projection that Vulkan programs write (90 degrees: f = 1, aspect 2, y flipped, depth 0
    /// to 1) times its claimed inverse is the identity.
    #[test]
    fn the_projection_is_inverted() {
        let m = matrices(&camera(), 2.0);
        let (n, f) = (0.5_f32, 8.0_f32);
        let projection =
            [[0.5, 0., 0., 0.], [0., -1., 0., 0.], [0., 0., f / (n - f), n * f / (n - f)], [0., 0., -1., 0.]];
        for (row, values) in projection.iter().enumerate() {
            for column in 0..4 {
                let sum: f32 = (0..4).map(|k| values[k] * m[16 + 4 * column + k]).sum();
                let wanted = if row == column { 1.0 } else { 0.0 };
                assert!((sum - wanted).abs() < 1e-6, "{row} {column}: {sum}");
            }
        }
    }

    #[test]
    fn the_axes_are_orthonormal_and_look_at_the_target() {
        let camera = Camera { eye: [4.0, 3.0, 1.0], look_at: [0.0, 1.0, -2.0], ..camera() };
        let m = matrices(&camera, 1.0);
        let axis = |i: usize| [m[4 * i], m[4 * i + 1], m[4 * i + 2]].map(f64::from);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        for i in 0..3 {
            for j in 0..3 {
                assert!((dot(axis(i), axis(j)) - f64::from(u8::from(i == j))).abs() < 1e-6);
            }
        }
        let sight = normalized([4.0, 2.0, 3.0]).unwrap();
        assert!(dot(axis(2), sight) > 1.0 - 1e-6);
        assert!(axis(1)[1] > 0.0, "up is up");
        assert!(dot(cross(axis(0), axis(1)), axis(2)) > 0.999, "right-handed");
    }

    #[test]
    fn impossible_cameras_are_refused() {
        let base = camera();
        let cases = [
            (Camera { look_at: base.eye, ..base.clone() }, "same point"),
            (Camera { up: [0.0, 0.0, 2.0], ..base.clone() }, "parallel"),
            (Camera { fov: 180.0, ..base.clone() }, "field of view"),
            (Camera { near: 9.0, ..base.clone() }, "near < far"),
            (Camera { eye: [f32::NAN, 0.0, 0.0], ..base.clone() }, "finite"),
            (Camera { aspect: Some(0.0), ..base }, "aspect"),
        ];
        for (camera, wanted) in cases {
            let error = camera.view(1.0).unwrap_err();
            assert!(error.contains(wanted), "{error}");
        }
    }

    fn columns(matrix: DMat4) -> [f32; 16] {
        matrix.to_cols_array().map(|x| x as f32)
    }

    #[test]
    fn forward_matrices_by_hand() {
        let view = camera().view(2.0).unwrap();
        // The axes are the world's: the view is a shift by (-1, -2, -3).
        let shift = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., -1., -2., -3., 1.];
        assert_eq!(columns(view.matrix(CameraMatrix::View)), shift);
        // f / (n - f) = 8 / -7.5 and n f / (n - f) = 4 / -7.5.
        let (a, b) = ((-8.0 / 7.5) as f32, (-4.0 / 7.5) as f32);
        let projection = [0.5, 0., 0., 0., 0., -1., 0., 0., 0., 0., a, -1., 0., 0., b, 0.];
        assert_eq!(columns(view.matrix(CameraMatrix::Projection)), projection);
        // The last column is the projection of (-1, -2, -3): x / 2, -y, a z + b, -z.
        let depth = (8.0 / 7.5 * 3.0 - 4.0 / 7.5) as f32;
        let both = [0.5, 0., 0., 0., 0., -1., 0., 0., 0., 0., a, -1., -0.5, 2., depth, 3.];
        assert_eq!(columns(view.matrix(CameraMatrix::ViewProjection)), both);
        // The centre of the near plane in clip space, (0, 0, 0, 1), is (1, 2, 3 - 0.5), times 1 / w
        // = 2.
        let back = view.matrix(CameraMatrix::ViewProjectionInverse);
        assert_eq!(back.w_axis.to_array(), [2.0, 4.0, 5.0, 2.0]);
    }

    #[test]
    fn scale_and_mirroring_do_not_count() {
        let turn = DMat4::from_rotation_y(0.5) * DMat4::from_rotation_x(0.25);
        let shift = DMat4::from_translation(glam::DVec3::new(1.0, 2.0, 3.0));
        let close = |found: Option<DMat4>, wanted: DMat4| {
            let found = found.expect("axes");
            assert!(found.abs_diff_eq(wanted, 1e-12), "{found} {wanted}");
        };
        for scale in [[2.0, 3.0, 4.0], [1e-9, 1.0, 1e9], [-1.0, 1.0, 1.0], [-3.0, 1.0, 0.5]] {
            let scaled = DMat4::from_scale(glam::DVec3::from(scale));
            close(without_scale(shift * turn * scaled), shift * turn);
        }
        // A parent that stretches x shears its turned child, whose axes (2 c, s) and (-2 s, c)
        // are not at right angles. With z out of the plane, y keeps its direction.
        let sheared = DMat4::from_scale(glam::DVec3::new(2.0, 1.0, 1.0)) * DMat4::from_rotation_z(0.5);
        let (sine, cosine) = 0.5_f64.sin_cos();
        let y = glam::DVec3::new(-2.0 * sine, cosine, 0.0).normalize();
        let x = glam::DVec3::new(y.y, -y.x, 0.0);
        close(without_scale(sheared), DMat4::from_cols(x.extend(0.0), y.extend(0.0), DVec4::Z, DVec4::W));
        assert_eq!(without_scale(DMat4::from_scale(glam::DVec3::new(1.0, 0.0, 1.0))), None);
        assert_eq!(without_scale(DMat4::from_scale(glam::DVec3::new(0.0, 1.0, 1.0))), None);
    }

    /// tan(4 / 2) is negative: the angle is wider than half a turn.
    #[test]
    fn a_wrong_angle_is_named() {
        for slope in [2.0_f64.tan(), 0.0, -238.0, f64::INFINITY, f64::NAN] {
            for aspect in [None, Some(1.6)] {
                let wide = Projection::Perspective { slope, aspect, near: 0.1, far: 10.0 };
                let error = CameraView::new(DMat4::IDENTITY, &wide, 1.6).unwrap_err();
                assert!(error.contains("the vertical angle of view") && !error.contains("1.6"), "{error}");
            }
        }
        let flat = Projection::Perspective { slope: 1.0, aspect: Some(-1.6), near: 0.1, far: 10.0 };
        assert!(CameraView::new(DMat4::IDENTITY, &flat, 1.0).unwrap_err().contains("-1.6"));
    }

    #[test]
    fn orthographic_cameras_and_planes_without_end() {
        let ortho = Projection::Orthographic { half: [2.0, 4.0], near: 1.0, far: 5.0 };
        let view = CameraView::new(DMat4::IDENTITY, &ortho, 1.0).unwrap();
        // A corner of the far plane is (1, -1, 1) in clip space, whose y points down.
        assert_eq!(view.projection * DVec4::new(2.0, 4.0, -5.0, 1.0), DVec4::new(1.0, -1.0, 1.0, 1.0));
        assert_eq!(
            view.projection_inverse * DVec4::new(1.0, -1.0, 0.0, 1.0),
            DVec4::new(2.0, 4.0, -1.0, 1.0)
        );
        let endless = Projection::Perspective { slope: 1.0, aspect: None, near: 0.5, far: f64::INFINITY };
        let view = CameraView::new(DMat4::IDENTITY, &endless, 1.0).unwrap();
        assert_eq!(view.projection.z_axis.to_array(), [0.0, 0.0, -1.0, -1.0]);
        assert_eq!(view.projection.w_axis.to_array(), [0.0, 0.0, -0.5, 0.0]);
        assert_eq!(view.projection_inverse.z_axis.to_array(), [0.0, 0.0, 0.0, -2.0]);
    }
}
