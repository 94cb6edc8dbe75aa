//! A pinhole camera as the two inverse matrices that ray-generation shaders usually take.
//!
//! View space is right-handed and looks along -z with y up. Clip space is Vulkan's: y points down,
//! depth goes from 0 at the near plane to 1 at the far plane. A ray-generation shader gets a ray by
//! ```glsl
//! vec2 d = 2.0 * (vec2(gl_LaunchIDEXT.xy) + 0.5) / vec2(gl_LaunchSizeEXT.xy) - 1.0;
//! vec3 origin = view_inverse[3].xyz;
//! vec3 direction = mat3(view_inverse) * normalize((projection_inverse * vec4(d, 1, 1)).xyz);
//! ```

use crate::scene::read::{Parse, Table, TomlValue};

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
    /// `view_inverse`, then `projection_inverse`, both column-major.
    ///
    /// # Errors
    /// Says what is wrong with the camera.
    pub fn matrices(&self, aspect: f32) -> Result<[f32; 32], String> {
        let aspect = self.aspect.unwrap_or(aspect);
        let numbers = [self.eye, self.look_at, self.up].concat();
        if !numbers.iter().chain([&self.near, &self.far, &aspect]).all(|x| x.is_finite()) {
            return Err("a camera's numbers are finite".into());
        }
        if !(self.fov > 0.0 && self.fov < 180.0) {
            return Err(format!("the angle of view, {}, is not between 0 and 180 degrees", self.fov));
        }
        if !(self.near > 0.0 && self.far > self.near) {
            return Err(format!("the planes, {} and {}, are not 0 < near < far", self.near, self.far));
        }
        if aspect <= 0.0 {
            return Err(format!("the aspect ratio, {aspect}, is not above 0"));
        }
        let back = normalized(sub(self.eye, self.look_at)).ok_or("`eye` and `look_at` are the same point")?;
        let right = normalized(cross(self.up.map(f64::from), back))
            .ok_or("`up` is zero or parallel to the line of sight")?;
        let up = cross(back, right);
        // tan(fov / 2), correctly rounded in f32 so that every machine makes the same picture.
        let slope = f64::from(pxfm::f_tanpif(self.fov / 360.0));
        let mut m = [0.0; 32];
        for (column, axis) in [right, up, back, self.eye.map(f64::from)].iter().enumerate() {
            m[4 * column..4 * column + 3].copy_from_slice(axis);
        }
        m[15] = 1.0;
        let (near, far) = (f64::from(self.near), f64::from(self.far));
        m[16] = slope * f64::from(aspect);
        m[21] = -slope;
        m[27] = 1.0 / far - 1.0 / near;
        m[30] = -1.0;
        m[31] = 1.0 / near;
        Ok(m.map(|x| x as f32))
    }
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f64; 3] {
    std::array::from_fn(|i| f64::from(a[i]) - f64::from(b[i]))
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
        let m = camera().matrices(2.0).unwrap();
        // Looks along -z from (1, 2, 3): the axes are the world's, the last column is the eye.
        assert_eq!(m[..16], [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 1., 2., 3., 1.]);
        // tan 45 degrees = 1; 1/8 - 1/0.5 = -1.875; 1/0.5 = 2. Column-major.
        assert_eq!(m[16..], [2., 0., 0., 0., 0., -1., 0., 0., 0., 0., 0., -1.875, 0., 0., -1., 2.]);
    }

    /// The projection that Vulkan programs write (90 degrees: f = 1, aspect 2, y flipped, depth 0
    /// to 1) times its claimed inverse is the identity.
    #[test]
    fn the_projection_is_inverted() {
        let m = camera().matrices(2.0).unwrap();
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
        let m = camera.matrices(1.0).unwrap();
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
            (Camera { fov: 180.0, ..base.clone() }, "angle of view"),
            (Camera { near: 9.0, ..base.clone() }, "near < far"),
            (Camera { eye: [f32::NAN, 0.0, 0.0], ..base.clone() }, "finite"),
            (Camera { aspect: Some(0.0), ..base }, "aspect"),
        ];
        for (camera, wanted) in cases {
            let error = camera.matrices(1.0).unwrap_err();
            assert!(error.contains(wanted), "{error}");
        }
    }
}
