//! Sets up the invocation of a shader under test: builtins, payload, attributes, resources.

use crate::bound::blocks;
use crate::fit::check_block;
use crate::shader_test::{ShaderTest, invalid};
use anyhit_base::error::Result;
use anyhit_engine::machine::{Batch, Buffer, Invocation, ShaderRecord};
use anyhit_engine::ops::builtin::BUILTINS;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::reflect::{Layout, Rules};

impl ShaderTest {
    pub(super) fn invocation(&self) -> Result<(Invocation, Option<[u32; 2]>)> {
        let [[x, y, z], [width, height, depth]] = self.launch;
        if x >= width || y >= height || z >= depth {
            let message = format!("the launch id ({x}, {y}, {z}) is outside {width} x {height} x {depth}");
            let how = "call `.launch(id, size)` with an id below the size, or set an inconsistent \
                `LaunchIdKHR` with `.builtin`";
            return Err(invalid(message).note(how));
        }
        let mut invocation = Invocation {
            launch_id: self.launch[0],
            launch_size: self.launch[1],
            trace: self.trace,
            t_max: self.trace.map_or(0.0, |trace| trace.ray.t_max),
            record: self.record()?,
            depth: 1,
            ..Invocation::default()
        };
        // A launch index that is set by name is that of a trap, too.
        let by_name = self.builtins.iter().rfind(|(builtin, _)| builtin.name == "LaunchIdKHR");
        if let Some((_, words)) = by_name
            && let &[x, y, z] = &words[..]
        {
            invocation.launch_id = [x, y, z];
        }
        let Some(hit) = self.hit.clone() else { return Ok((invocation, None)) };
        let resolved = hit.resolve()?;
        let attributes = resolved.hit.candidate.intersection.attributes.map(f32::to_bits);
        invocation.trace = Some(resolved.trace);
        invocation.t_max = resolved.t;
        invocation.hit = Some(resolved.hit);
        Ok((invocation, Some(attributes)))
    }

    fn record(&self) -> Result<Option<ShaderRecord>> {
        let Some(given) = &self.record else { return Ok(None) };
        let mut blocks = blocks(&self.program);
        if let Some((ty, ..)) = blocks.find(|block| block.1 == storage::SHADER_RECORD_BUFFER) {
            let layout = Layout::new(&self.program.module, ty, Rules::Explicit);
            check_block(layout, "the shader record", &given.rust, &|| given.bytes.clone())?;
        }
        let data = Buffer::new(&given.bytes);
        Ok(Some(ShaderRecord { offset: 0, size: data.size(), data }))
    }

    /// Checks that the shader reads every builtin that the test sets by name.
    pub(super) fn check_builtins(&self) -> Result<()> {
        if self.builtins.is_empty() {
            return Ok(());
        }
        let (module, stage, name) = (&self.program.module, self.program.stage, &self.program.name);
        let entry = module.entry_points.iter().find(|entry| entry.stage == stage && entry.name == *name);
        let variables = entry.map_or_else(Vec::new, |entry| module.interface_of(entry));
        let mut read: Vec<&str> = self.program.inputs.iter().map(|input| input.builtin.name).collect();
        for number in variables.iter().filter_map(|variable| variable.builtin) {
            let known = BUILTINS.iter().find(|known| known.number == number);
            if let Some(builtin) = known.filter(|builtin| !read.contains(&builtin.name)) {
                read.push(builtin.name);
            }
        }
        let Some((unread, _)) = self.builtins.iter().find(|(set, _)| !read.contains(&set.name)) else {
            return Ok(());
        };
        let stage = stage.name();
        let error = invalid(format!("{stage} `{name}` does not read {}, which the test sets", unread.name));
        Err(error.note(match read.is_empty() {
            true => "it reads no builtin: leave out `.builtin`".to_owned(),
            false => format!("it reads {}", read.join(", ")),
        }))
    }

    pub(super) fn override_builtins(&self, batch: &mut Batch<1>) {
        for (builtin, words) in &self.builtins {
            for registers in self.program.inputs.iter().filter(|registers| registers.builtin == *builtin) {
                batch.registers.set_lane_words(registers.first, 0, words.iter().copied());
            }
        }
    }

    pub(super) fn fill_payload(&self, batch: &mut Batch<1>) -> Result<()> {
        if self.payload.is_none() && self.members.is_empty() {
            return Ok(());
        }
        let Some(registers) = self.payload_rows() else {
            let given = self.payload.as_ref().map_or("members", |given| &given.rust.name);
            return Err(invalid(format!("the shader does not use the given payload: `{given}`")));
        };
        let mut data = self.data(batch, registers, "the payload");
        if let Some(given) = &self.payload {
            data.take(given)?;
        }
        for (path, scalars) in &self.members {
            data.set(path, scalars)?;
        }
        batch.registers.set_lane_words(registers.first, 0, data.words());
        Ok(())
    }

    pub(super) fn fill_attributes(&self, batch: &mut Batch<1>) -> Result<()> {
        let Some(given) = &self.attributes else { return Ok(()) };
        let Some(registers) = self.program.interface_registers(storage::HIT_ATTRIBUTE) else {
            let given = &given.rust.name;
            return Err(invalid(format!("the shader does not use the given hit attributes: `{given}`")));
        };
        let mut data = self.data(batch, registers, "the hit attributes");
        data.take(given)?;
        batch.registers.set_lane_words(registers.first, 0, data.words());
        Ok(())
    }
}
