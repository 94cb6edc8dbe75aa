//! Reads `geometryG.*`: the geometries of the one BLAS of a recording.

use crate::recording::tensors::Tensors;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::{EndCaps, Geometry, GeometryData, GeometryFlags, Indexing};

/// Reads `geometry0.*`, `geometry1.*`, ... until there is none; what is left out is described in
/// `notes`.
pub(super) fn read(tensors: &Tensors<'_>, notes: &mut Vec<String>) -> Result<Vec<Geometry>> {
    let mut geometries = Vec::new();
    while let Some(geometry) = geometry(tensors, geometries.len(), notes)? {
        geometries.push(geometry);
    }
    if geometries.is_empty() {
        return Err(tensors.missing("geometry0.vertices").note(
            "a geometry is `geometryG.vertices` (triangles), `geometryG.aabb` (boxes), \
             or `geometryG.positions` with `geometryG.radii` (spheres, linear swept spheres)",
        ));
    }
    if let Some(name) = tensors.geometry_from(geometries.len()) {
        let message = format!("tensor `{name}` is present, but geometry {} is missing", geometries.len());
        return Err(Error::new(ErrorKind::InvalidRecording, message));
    }
    Ok(geometries)
}

fn geometry(tensors: &Tensors<'_>, index: usize, notes: &mut Vec<String>) -> Result<Option<Geometry>> {
    let name = |part: &str| format!("geometry{index}.{part}");
    let indices = tensors.indices(&name("indices"))?;
    let data = if let Some(vertices) = tensors.points(&name("vertices"))? {
        let transform = tensors.matrix(&name("transform"))?;
        GeometryData::Triangles { vertices, indices, transform }
    } else if let Some(boxes) = tensors.rows::<6>(&name("aabb"))? {
        GeometryData::Aabbs(boxes)
    } else {
        let (positions, radii) = (tensors.points(&name("positions"))?, tensors.singles(&name("radii"))?);
        let (positions, radii) = match (positions, radii) {
            (None, None) => return Ok(None),
            // A single radius is used for all positions, as a radius stride of 0.
            (Some(positions), Some(radii)) if radii.len() == 1 => {
                let radii = vec![radii[0]; positions.len()];
                (positions, radii)
            }
            (Some(positions), Some(radii)) => (positions, radii),
            (None, Some(_)) => return Err(tensors.missing(&name("positions"))),
            (Some(_), None) => return Err(tensors.missing(&name("radii"))),
        };
        // Vulkan forbids negative radii, and drivers treat them differently.
        let negative = radii.iter().filter(|radius| **radius < 0.0).count();
        if negative > 0 {
            notes.push(format!(
                "{negative} radii of `{}` are negative, which is invalid: their primitives are inactive",
                name("radii")
            ));
        }
        let radii = radii.into_iter().map(|radius| if radius < 0.0 { f32::NAN } else { radius }).collect();
        spheres_or_linear_swept_spheres(tensors, &name, positions, radii, indices)?
    };
    let flag = |part: &str, flag: GeometryFlags, without: bool| {
        let set = tensors.integer(&name(part))?.map_or(without, |word| word != 0);
        Ok::<_, Error>(if set { flag.0 } else { 0 })
    };
    let flags = flag("opaque", GeometryFlags::OPAQUE, false)?
        | flag("no_duplicate_any_hit", GeometryFlags::NO_DUPLICATE_ANY_HIT, true)?;
    Ok(Some(Geometry::new(data, GeometryFlags(flags))))
}

/// Makes spheres or linear swept spheres: as the metadata's `kind` says, otherwise as the driver's
/// shaders recorded, otherwise linear swept spheres if there are indices.
fn spheres_or_linear_swept_spheres(
    tensors: &Tensors<'_>,
    name: &impl Fn(&str) -> String,
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
    indices: Option<Vec<u32>>,
) -> Result<GeometryData> {
    let mode = tensors.integer(&name("indexing_mode"))?;
    let caps = tensors.integer(&name("end_caps"))?;
    let swept = match tensors.metadata_value("kind") {
        Some("sphere" | "spheres") => false,
        Some("lss" | "linear_swept_spheres") => true,
        _ if mode.is_some() || caps.is_some() || tensors.any("driver.is_lss")? => true,
        _ if tensors.any("driver.is_sphere")? => false,
        _ => match tensors.row_length("driver.position_radius") {
            Some(4) => false,
            Some(8) => true,
            _ => indices.is_some(),
        },
    };
    if !swept {
        return Ok(GeometryData::Spheres { positions, radii, indices });
    }
    let other = |part: &str, word: i64, values: &str| {
        let message = format!("tensor `{}` is {word}: expected {values}", name(part));
        Error::new(ErrorKind::InvalidRecording, message)
    };
    let indexing = match mode {
        None if indices.is_some() => Indexing::Successive,
        None | Some(0) => Indexing::List,
        Some(1) => Indexing::Successive,
        Some(word) => return Err(other("indexing_mode", word, "0 (list) or 1 (successive)")),
    };
    let end_caps = match caps {
        Some(0) => EndCaps::None,
        None | Some(1) => EndCaps::Chained,
        Some(word) => return Err(other("end_caps", word, "0 (none) or 1 (chained)")),
    };
    Ok(GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, end_caps })
}
