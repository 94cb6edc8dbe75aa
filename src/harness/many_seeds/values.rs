//! Draws values in registers while shaders run: undefined ones, and sums that may be contracted.

use std::sync::Arc;

use crate::harness::many_seeds::contraction::{Contractions, LiveProducts};
use crate::harness::many_seeds::undefined::UndefinedParts;
use crate::machine::{Batch, Bindings, Observer, OpIndex, OpenChoices, ShaderIndex};
use crate::program::Program;

/// What is open about the values of a shader.
#[derive(Debug)]
pub(super) struct OpenValues {
    program: Arc<Program>,
    undefined: UndefinedParts,
    contractions: Contractions,
}

impl OpenValues {
    /// What is open about the values of a program that is not optimised.
    pub(super) fn of(program: &Arc<Program>) -> Self {
        let (undefined, contractions) = (UndefinedParts::of(program), Contractions::of(program));
        Self { program: program.clone(), undefined, contractions }
    }
}

/// Draws values in the shaders of a launch or a dispatch.
#[derive(Debug)]
pub(super) struct ValueDraws<'a> {
    shaders: &'a [OpenValues],
    /// By shader, the choices for it.
    choices: Vec<OpenChoices>,
    /// The shader that runs.
    shader: ShaderIndex,
    products: LiveProducts,
}

impl<'a> ValueDraws<'a> {
    /// Draws for the shaders of a pipeline, or for a compute shader.
    pub(super) fn new(shaders: &'a [OpenValues], choices: &OpenChoices) -> Self {
        let of_shader = |at| choices.in_shader(ShaderIndex::new(at));
        let choices = (0..shaders.len()).map(of_shader).collect();
        Self { shaders, choices, shader: ShaderIndex(0), products: LiveProducts::default() }
    }
}

impl<const W: usize> Observer<W> for ValueDraws<'_> {
    fn began(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        self.shaders[shader.index()].undefined.begin(&self.choices[shader.index()], batch);
    }

    fn resumed(&mut self, shader: ShaderIndex, _: &mut Batch<W>) {
        self.shader = shader;
        self.products.clear();
    }

    fn after(&mut self, batch: &mut Batch<W>, _: &Bindings, op: OpIndex) {
        let (shader, choices) = (&self.shaders[self.shader.index()], &self.choices[self.shader.index()]);
        shader.undefined.after(choices, op, batch);
        let executed = &shader.program.ops[op.index()];
        shader.contractions.after(choices, op, executed, &mut self.products, batch);
    }
}
