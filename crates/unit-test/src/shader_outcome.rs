//! What one invocation of a shader left.

use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::AnyBitPattern;

use serde::Serialize;

use crate::bound::{Bound, reads_what_is_bound};
use crate::data::TypedBytes;
use crate::explain::{Explain, Explanation};
use crate::mock::{CallableCall, ExecuteCall, TraceCall};
use crate::normal::{difference, vector_at};
use crate::value::Value;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::{HitPrimitive, Tlas, TraceRay, surface_normal};
use anyhit_engine::geometry::SurfaceNormal;
use anyhit_engine::machine::Exit;

/// A report of an intersection shader.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ReportedHit {
    /// The hit distance.
    pub t: f32,
    /// The hit kind.
    pub kind: u32,
    /// The hit attributes.
    pub attributes: Value,
    /// The answer: whether t lies in the ray's interval, unless the test answers itself.
    pub accepted: bool,
}

/// Result of one invocation. Serde writes it without calls and their answers.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
#[must_use]
pub struct ShaderOutcome {
    /// How it ended: returned, ignored the intersection, terminated the ray.
    pub exit: Exit,
    /// The payload, or the callable data, by the names of its members.
    pub payload: Value,
    /// The hit attributes.
    pub attributes: Value,
    /// The reports of an intersection shader, in order.
    pub reports: Vec<ReportedHit>,
    /// The traces that it made, with their answers.
    #[serde(skip)]
    pub traces: Vec<TraceCall>,
    /// The hit objects that it executed, with their answers.
    #[serde(skip)]
    pub executes: Vec<ExecuteCall>,
    /// The callable shaders that it called, with their answers.
    #[serde(skip)]
    pub calls: Vec<CallableCall>,
    /// What it printed (`debugPrintfEXT`).
    pub printed: Vec<String>,
    #[serde(skip)]
    pub(super) data: Option<TypedBytes>,
    #[serde(skip)]
    pub(super) bound: Bound,
    #[serde(skip)]
    pub(super) explanation: Arc<Explanation>,
    /// What was hit, by which ray in which structure.
    #[serde(skip)]
    pub(super) hit: Option<(Arc<Tlas>, TraceRay, HitPrimitive)>,
}

impl ShaderOutcome {
    /// The payload, or the callable data, as a plain Rust type: see
    /// `docs/testing.md`, "Reading values", for how its scalars lie.
    ///
    /// # Errors
    /// `InvalidArgument` where size or types differ; it shows both layouts.
    pub fn payload<T: AnyBitPattern + Debug>(&self) -> Result<T> {
        match &self.data {
            Some(data) => data.read(),
            None => self.payload.read(),
        }
    }

    /// The exact unit normal in world space of the triangle, sphere or linear swept sphere that the
    /// [`Hit`](crate::hit::Hit) is of, towards the ray's origin; each component is correctly
    /// rounded. `None` for a box, and for a shader without a hit.
    #[must_use]
    pub fn exact_normal(&self) -> Option<[f32; 3]> {
        self.surface_normal().map(|normal| normal.world)
    }

    /// As [`Self::exact_normal`], in the object space of the instance.
    #[must_use]
    pub fn exact_object_normal(&self) -> Option<[f32; 3]> {
        self.surface_normal().map(|normal| normal.object)
    }

    /// Checks that a member of the payload is the normal of what was hit in world space, of any
    /// length, within so many degrees of [the exact one](Self::exact_normal). A path without a name
    /// is the whole payload.
    ///
    /// ```
    /// use anyhit::{Hit, Module, Ray, ShaderTest};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let module = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
    /// let hit = Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.3, 0.0, 4.0], [0.0, 0.0, -1.0]));
    /// let outcome = ShaderTest::new(&module, "main")?.hit(hit).run()?;
    /// outcome.check_normal("normal", 0.001)?;
    /// // 0.3 of a radius of 0.5, and the rest of a unit vector.
    /// let [x, y, z] = outcome.exact_normal().expect("the normal of a sphere");
    /// assert!((x - 0.6).abs() < 1e-7 && y == 0.0 && (z - 0.8).abs() < 1e-7);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `Expectation` where it is farther away, with both; `InvalidArgument` where the payload has
    /// no such vector, or the hit no exact normal.
    pub fn check_normal(&self, member: &str, degrees: f64) -> Result<()> {
        let wrong = |message: String| Error::new(ErrorKind::InvalidArgument, message);
        let exact = self.exact_normal().ok_or_else(|| {
            let message =
                "an exact normal is known only for hits of triangles, spheres and linear swept spheres";
            wrong(message.to_owned())
        })?;
        let (found, _) = vector_at(&self.payload, Some(member)).map_err(wrong)?;
        match difference(found, exact, degrees) {
            None => Ok(()),
            Some(message) => Err(Error::new(ErrorKind::Expectation, format!("{member}: {message}"))),
        }
    }

    fn surface_normal(&self) -> Option<SurfaceNormal> {
        let (tlas, trace, hit) = self.hit.as_ref()?;
        surface_normal(tlas, trace, *hit)
    }
}

reads_what_is_bound!(ShaderOutcome);

impl Explain for ShaderOutcome {
    fn explain(&self) -> String {
        self.explanation.text()
    }
}
