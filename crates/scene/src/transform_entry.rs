//! Transforms as a scene writes them: a matrix, or translation, rotation and scale.

use glam::{DMat4, DVec4};

use crate::read::{OneOrMore, Parse, Spanned, Table, TomlValue};
use crate::tree::Toml;
use anyhit_engine::math::array;

/// Reads `transform`, or `scale`, `rotate` and `translate`, which apply in this order.
pub(super) fn parse_transform(table: &Table<'_>) -> Option<[[f32; 4]; 3]> {
    let matrix = table.optional::<Matrix>("transform");
    let translate = table.or("translate", [0.0; 3]);
    let rotate = table.optional::<Rotation>("rotate");
    let scale = table.optional::<OneOrMore<f32>>("scale");
    let has_components = ["translate", "rotate", "scale"].iter().any(|key| table.has(key));
    if !has_components {
        return matrix.map(|matrix| matrix.0);
    }
    if let Some(value) = table.value("transform") {
        return value.wrong("`transform` excludes `translate`, `rotate` and `scale`");
    }
    let scale = match &scale {
        Some(scale) => scale_vector(table.value("scale")?, scale)?,
        None => [1.0; 3],
    };
    let rotation = rotate.map_or([[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]], |rotation| rotation.matrix());
    Some(array::from_fn(|row| {
        array::from_fn(|column| match column {
            3 => translate[row],
            _ => (rotation[row][column] * f64::from(scale[column])) as f32,
        })
    }))
}

/// Reads a scale: one number for all axes, or three.
pub(super) fn scale_vector(value: TomlValue<'_>, scale: &OneOrMore<f32>) -> Option<[f32; 3]> {
    match scale.0[..] {
        [all] => Some([all; 3]),
        [x, y, z] => Some([x, y, z]),
        _ => value.wrong("`scale` must be one number or three"),
    }
}

/// A matrix as three rows of four, or as twelve numbers in that order (`VkTransformMatrixKHR`).
struct Matrix([[f32; 4]; 3]);

impl Parse for Matrix {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let nested =
            value.elements().is_some_and(|mut rows| rows.any(|row| matches!(row.toml(), Toml::Array(_))));
        if nested {
            return <[[f32; 4]; 3]>::parse(value).map(Self);
        }
        let flat = <[f32; 12]>::parse(value)?;
        Some(Self(array::from_fn(|row| array::from_fn(|column| flat[4 * row + column]))))
    }
}

pub(super) struct Rotation {
    axis: [f32; 3],
    degrees: f32,
}

impl Parse for Rotation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let axis = table.required::<Spanned<[f32; 3]>>("axis");
        let degrees = table.required("degrees");
        table.finish();
        let (axis, degrees) = (axis?, degrees?);
        if axis.value == [0.0; 3] || axis.value.iter().any(|x| !x.is_finite()) {
            value.report().push(axis.span.error("an axis must be finite and not zero"));
            return None;
        }
        Some(Self { axis: axis.value, degrees })
    }
}

impl Rotation {
    /// The quaternion x, y, z, w.
    pub(super) fn quaternion(&self) -> [f32; 4] {
        // Half of the angle, in units of half turns.
        let half = self.degrees / 360.0;
        let (sine, cosine) = (f64::from(pxfm::f_sinpif(half)), pxfm::f_cospif(half));
        let [x, y, z] = self.unit_axis().map(|x| (x * sine) as f32);
        [x, y, z, cosine]
    }

    fn unit_axis(&self) -> [f64; 3] {
        let a = self.axis.map(f64::from);
        let length = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
        a.map(|x| x / length)
    }

    /// The matrix by Rodrigues' formula, with sine and cosine of half turns, so that right angles
    /// are exact.
    fn matrix(&self) -> [[f64; 3]; 3] {
        let half_turns = self.degrees / 180.0;
        let (sine, cosine) = (f64::from(pxfm::f_sinpif(half_turns)), f64::from(pxfm::f_cospif(half_turns)));
        let a = self.unit_axis();
        let cross = [[0., -a[2], a[1]], [a[2], 0., -a[0]], [-a[1], a[0], 0.]];
        array::from_fn(|i| {
            array::from_fn(|j| {
                let one = if i == j { cosine } else { 0.0 };
                one + sine * cross[i][j] + (1.0 - cosine) * a[i] * a[j]
            })
        })
    }
}

/// A 3x4 matrix, as a scene writes a transform.
pub(super) fn matrix_of(rows: &[[f32; 4]; 3]) -> DMat4 {
    let [x, y, z] = rows.map(|row| DVec4::from_array(row.map(f64::from)));
    DMat4::from_cols(x, y, z, DVec4::W).transpose()
}
