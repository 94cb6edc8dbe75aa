//! Runs pipelines on the scenes of a host: the methods of [`Pipeline`] that a test calls.

use crate::pipeline::{Band, Pipeline, RayOperands, StreamedImage};
use anyhit_base::error::Result;

/// A scene that a host holds and pipelines run on: in the crate `anyhit` its `Scene`.
pub trait HostScene {
    /// What a launch leaves.
    type Launched;
    /// What a ray brings back.
    type Traced;

    /// Runs [`Pipeline::launch`].
    ///
    /// # Errors
    /// As [`Pipeline::launch`].
    fn launched(&self, pipeline: &Pipeline, size: [u32; 3]) -> Result<Self::Launched>;

    /// Runs [`Pipeline::launch_bands`].
    ///
    /// # Errors
    /// As [`Pipeline::launch_bands`].
    fn launched_in_bands(
        &self,
        pipeline: &Pipeline,
        size: [u32; 2],
        image: &StreamedImage,
        take: impl FnMut(Band<'_>) -> Result<()> + Send,
    ) -> Result<Self::Launched>;

    /// Runs [`Pipeline::trace`].
    ///
    /// # Errors
    /// As [`Pipeline::trace`].
    fn traced(&self, pipeline: &Pipeline, ray: RayOperands) -> Result<Self::Traced>;

    /// Keeps what the shaders of a launch wrote.
    fn keep_launched(&mut self, launched: &Self::Launched);

    /// Keeps what the shaders of a ray wrote.
    fn keep_traced(&mut self, traced: &Self::Traced);
}

impl Pipeline {
    /// Runs the ray generation shader over a grid of (width, height, depth). What shaders write is
    /// in what is returned; the scene does not change and can be launched again, by several
    /// threads at once, too. Buffers and images that no shader can write are not copied.
    /// [`Pipeline::launch_mut`] writes to the scene.
    ///
    /// ```
    /// use anyhit::{Module, Pipeline, Program, Scene};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let module = Module::open("spirv-fixtures/pass/arithmetic/elementary/main.rgen.spv")?;
    /// let pipeline = Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.build()?;
    /// let inputs = [[4.0f32, 0.0, 0.0, 0.0], [9.0, 0.0, 0.0, 0.0]];
    /// let scene = Scene::new([])?.buffer(0, 2, &inputs).buffer(0, 1, &[[0.0f32; 4]; 16]);
    ///
    /// let launched = pipeline.launch(&scene, [2, 1, 1])?;
    /// let outputs = launched.buffer(0, 1)?;
    /// assert_eq!(outputs["outputs"][1][3]["w"].f32(), 9.0);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// All threads of rayon's pool run it. In a process that was forked after a launch, which has
    /// none of them, the calling thread does; the results are the same.
    ///
    /// # Errors
    /// `Trap`, that of the lowest launch index, where a shader misbehaves; `InvalidScene` without a
    /// ray generation shader; `InvalidArgument` for a grid without or with too many invocations,
    /// and for a buffer whose size, or an image whose format, is not the shaders', with both.
    pub fn launch<S: HostScene>(&self, scene: &S, size: [u32; 3]) -> Result<S::Launched> {
        scene.launched(self, size)
    }

    /// Runs the ray generation shader as [`Pipeline::launch`] does, and leaves in the scene what
    /// shaders write: the next launch finds it. Clones of the scene, and outcomes of earlier
    /// launches, do not change.
    ///
    /// ```
    /// use anyhit::{Module, Pipeline, Program, Scene};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// // Each invocation adds its index, counted from 1, to its number.
    /// let module = Module::open("spirv-fixtures/pass/harness/conversions/accumulate.rgen.spv")?;
    /// let pipeline = Pipeline::builder().ray_generation(Program::of(&module, "main")?)?.build()?;
    /// # let picture = anyhit::Image::plane(anyhit::Format::new(anyhit::Component::Uint32, 1), 2, 1)?;
    /// let mut scene = Scene::new([])?.buffer(0, 0, &[10u32, 20]).image(0, 1, picture);
    ///
    /// let first = pipeline.launch_mut(&mut scene, [2, 1, 1])?;
    /// pipeline.launch_mut(&mut scene, [2, 1, 1])?;
    /// assert_eq!(scene.read_buffer::<u32>(0, 0)?, [12, 24]);
    /// assert_eq!(first.read_buffer::<u32>(0, 0)?, [11, 22]);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Pipeline::launch`]; the scene stays as it was then.
    pub fn launch_mut<S: HostScene>(&self, scene: &mut S, size: [u32; 3]) -> Result<S::Launched> {
        let launched = self.launch(scene, size)?;
        scene.keep_launched(&launched);
        Ok(launched)
    }

    /// Runs the ray generation shader over a grid of (width, height), and hands out the image that
    /// it fills, which is as wide and high, in bands of rows: the top one first, each while the
    /// next is being filled. So the image may be larger than memory. The scene binds everything but
    /// this image. Results are those of [`Pipeline::launch`] with the whole image, bit for bit.
    ///
    /// `examples/bands.rs` shows it.
    ///
    /// # Errors
    /// As [`Pipeline::launch`], and what `take` returns: no further band is handed out then.
    /// `InvalidArgument` where the image must be there as a whole, with the reason: that a shader
    /// may reach other rows of it than that of its launch index (or the same counted from the last
    /// one), or that it is not known not to.
    pub fn launch_bands<S: HostScene>(
        &self,
        scene: &S,
        size: [u32; 2],
        image: &StreamedImage,
        take: impl FnMut(Band<'_>) -> Result<()> + Send,
    ) -> Result<S::Launched> {
        scene.launched_in_bands(self, size, image, take)
    }

    /// Traces one ray through a scene, without a ray generation shader. What shaders write is in
    /// what is returned; the scene does not change. [`Pipeline::trace_mut`] writes to the scene.
    ///
    /// # Errors
    /// `Trap` where a shader misbehaves; `InvalidArgument` for a payload or a buffer whose size
    /// fits no shader, or an image of another format than declared, with both, and for a ray that
    /// breaks a rule, with its VUID, or has unknown flags.
    pub fn trace<S: HostScene>(&self, scene: &S, ray: impl Into<RayOperands>) -> Result<S::Traced> {
        scene.traced(self, ray.into())
    }

    /// Traces one ray as [`Pipeline::trace`] does, and leaves in the scene what shaders write: the
    /// next ray finds it.
    ///
    /// # Errors
    /// As [`Pipeline::trace`]; the scene stays as it was then.
    pub fn trace_mut<S: HostScene>(&self, scene: &mut S, ray: impl Into<RayOperands>) -> Result<S::Traced> {
        let traced = self.trace(scene, ray)?;
        scene.keep_traced(&traced);
        Ok(traced)
    }
}
