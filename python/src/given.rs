//! The methods that tests of one shader share: what they bind.

/// Methods of a test class with the fields `test`, `module`, `program` and `used`, and the methods
/// `with` and `binding`.
macro_rules! binds_resources {
    ($test:ident) => {
        #[pymethods]
        impl $test {
            /// Binds a storage or uniform buffer: an array, C-contiguous, whose dtype and shape are
            /// compared with what the shader declares; `bytes` or an array of `uint8`, which are
            /// not; or a dict by the names of its members.
            #[pyo3(signature = (set, binding=None, data=None))]
            fn buffer(
                &self,
                set: &Bound<'_, PyAny>,
                binding: Option<&Bound<'_, PyAny>>,
                data: Option<&Bound<'_, PyAny>>,
            ) -> PyResult<Self> {
                let (place, data) = crate::place::split_with("data", set, binding, data)?;
                let at = self.binding(&place)?;
                let bytes = crate::scene::buffer_bytes(at, data, &self.module)?;
                Ok(self.with("buffer", |test| test.buffer_of(at.set, at.binding, bytes)))
            }

            /// Binds a storage or sampled image: an array (height, width, 4) of float32, or of
            /// uint32, int32, uint64 or int64 for a shader that reads integers. It is stored in the
            /// format that the shader declares, unless `format` names another: GLSL's `"rgba32f"`,
            /// `"rgba8"`, `"r32ui"`. Images of other dimensions have their own axes; with a sampler
            /// it is a combined image sampler. `levels` are the arrays of its further mip levels,
            /// each of half the size.
            #[pyo3(signature = (set, binding=None, texels=None, format=None, sampler=None, *, levels=crate::argument::Objects::none()), text_signature = "($self, set, binding=None, texels=None, format=None, sampler=None, *, levels=())")]
            fn image(
                &self,
                set: &Bound<'_, PyAny>,
                binding: Option<&Bound<'_, PyAny>>,
                texels: Option<&Bound<'_, PyAny>>,
                #[pyo3(from_py_with = crate::argument::format)] format: Option<String>,
                #[pyo3(from_py_with = crate::argument::of_sampler)] sampler: Option<crate::sampler::Sampler>,
                #[pyo3(from_py_with = crate::argument::levels)] levels: crate::argument::Objects,
            ) -> PyResult<Self> {
                let (place, texels) = crate::place::split_with("texels", set, binding, texels)?;
                let at = self.binding(&place)?;
                let texels = crate::images::TexelArray::of(texels, format.as_deref(), &levels)?;
                let image = texels.image(crate::images::declared([&self.program], at))?;
                Ok(self.with("image", |test| match sampler {
                    Some(sampler) => test.image_sampler(at.set, at.binding, image, sampler.sampler),
                    None => test.image(at.set, at.binding, image),
                }))
            }

            /// Binds a sampler.
            #[pyo3(signature = (set, binding=None, sampler=None))]
            fn sampler(
                &self,
                set: &Bound<'_, PyAny>,
                binding: Option<&Bound<'_, PyAny>>,
                sampler: Option<&Bound<'_, PyAny>>,
            ) -> PyResult<Self> {
                use crate::argument::Argument;

                let (place, sampler) = crate::place::split_with("sampler", set, binding, sampler)?;
                let sampler = crate::sampler::Sampler::of("sampler", sampler)?.sampler;
                let sampler = anyhit::Descriptor::Sampler(Arc::new(sampler));
                let at = self.binding(&place)?;
                Ok(self.with("sampler", |test| test.descriptor(at.set, at.binding, sampler)))
            }

            /// Puts buffers at their device addresses, for shaders that reach them by pointers.
            fn device_buffers(
                &self,
                #[pyo3(from_py_with = crate::argument::buffers)] buffers: crate::argument::Buffers,
            ) -> Self {
                self.with("device_buffers", |test| test.device_buffers(&buffers.0))
            }

            /// Sets the push constants, by the names of their members.
            fn push_constants(&self, values: &Bound<'_, PyAny>) -> PyResult<Self> {
                let data = anyhit::StructData::push_constants(&self.module.module);
                let data = crate::scene::filled(data.map_err(crate::error::raised)?, "values", values)?;
                Ok(self.with("push_constants", |test| test.push_constants_data(&data)))
            }

            /// Sets how many instructions an invocation may execute.
            fn fuel(&self, #[pyo3(from_py_with = crate::argument::instructions)] instructions: u64) -> Self {
                self.with("fuel", |test| test.fuel(instructions))
            }
        }
    };
}
pub(crate) use binds_resources;
