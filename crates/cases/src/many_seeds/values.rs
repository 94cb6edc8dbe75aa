//! Draws values in registers while shaders run: undefined ones, and floats that may be calculated
//! otherwise.

use std::sync::Arc;

use crate::many_seeds::chains::{self, LiveChains};
use crate::many_seeds::contraction::{self, LiveProducts};
use crate::many_seeds::executed_kernel::ExecutedKernel;
use crate::many_seeds::float_arithmetic::FloatArithmetic;
use crate::many_seeds::float_licence::FloatLicences;
use crate::many_seeds::float_results;
use crate::many_seeds::robust_texels;
use crate::many_seeds::undefined::UndefinedParts;
use crate::many_seeds::undefined_results::UndefinedResults;
use crate::many_seeds::workgroup_memory::SharedVariables;
use anyhit_engine::machine::{Batch, Bindings, ChoiceKind, Observer, OpIndex, OpenChoices, ShaderIndex};
use anyhit_engine::ops::op::Op;
use anyhit_engine::program::Program;
use anyhit_sanitize::{Levels, ProgramPlan};

/// What is open about the values of a shader.
#[derive(Debug)]
pub(super) struct OpenValues {
    program: Arc<Program>,
    undefined: UndefinedParts,
    shared: SharedVariables,
    results: UndefinedResults,
    licences: FloatLicences,
}

impl OpenValues {
    /// What is open about the values of a program that is not optimised.
    pub(super) fn of(program: &Arc<Program>, levels: &Levels) -> Self {
        Self {
            program: program.clone(),
            undefined: UndefinedParts::of(program),
            shared: SharedVariables::of(program),
            results: UndefinedResults::of(&ProgramPlan::new(program), levels),
            licences: FloatLicences::of(program),
        }
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
    chains: LiveChains,
    arithmetic: FloatArithmetic,
}

impl<'a> ValueDraws<'a> {
    /// Draws for the shaders of a pipeline, or for a compute shader.
    pub(super) fn new(shaders: &'a [OpenValues], choices: &OpenChoices) -> Self {
        let of_shader = |at| choices.in_shader(ShaderIndex::new(at));
        Self {
            shaders,
            choices: (0..shaders.len()).map(of_shader).collect(),
            shader: ShaderIndex(0),
            products: LiveProducts::default(),
            chains: LiveChains::default(),
            arithmetic: FloatArithmetic::default(),
        }
    }

    /// Draws how the floats of an operation that has run are calculated.
    fn after_floats<const W: usize>(&mut self, batch: &mut Batch<W>, op: OpIndex) {
        let (shader, choices) = (&self.shaders[self.shader.index()], &self.choices[self.shader.index()]);
        let executed = &shader.program.ops[op.index()];
        self.products.follow(executed, batch);
        self.chains.follow(executed, batch);
        let Op::LaneKernel { kernel, to, from } = executed else { return };
        let Some(licence) = shader.licences.get(op) else { return };
        let (kernel, to) = (*kernel, *to);
        let one = ExecutedKernel { op, kernel, to, from, licence };
        if matches!(kernel.name, "FAdd" | "FSub" | "FMul" | "Fma") {
            let (products, arithmetic) = (&mut self.products, &mut self.arithmetic);
            let is_contracted = choices.kinds.contains(&ChoiceKind::Contraction)
                && contraction::after(one, choices, products, arithmetic, batch);
            // A sum that takes a product as it is has one rounding: there is no order in it.
            if !is_contracted {
                chains::after(one, choices, &mut self.chains, arithmetic, batch);
            }
        }
        if choices.kinds.iter().any(|kind| kind.is_of_fast_math()) {
            float_results::after(one, choices, &mut self.arithmetic, batch);
        }
    }
}

impl<const W: usize> Observer<W> for ValueDraws<'_> {
    fn began(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        let (shader, choices) = (&self.shaders[shader.index()], &self.choices[shader.index()]);
        shader.undefined.begin(choices, batch);
        shader.shared.begin(choices, batch);
    }

    fn resumed(&mut self, shader: ShaderIndex, _: &mut Batch<W>) {
        self.shader = shader;
        self.products.clear();
        self.chains.clear();
    }

    fn after(&mut self, batch: &mut Batch<W>, bindings: &Bindings, op: OpIndex) {
        let kinds = &self.choices[self.shader.index()].kinds;
        if kinds.iter().any(|kind| kind.is_contracted() || kind.is_of_fast_math()) {
            self.after_floats(batch, op);
        }
        let (shader, choices) = (&self.shaders[self.shader.index()], &self.choices[self.shader.index()]);
        shader.undefined.after(choices, op, batch);
        let executed = &shader.program.ops[op.index()];
        if choices.kinds.contains(&ChoiceKind::UndefinedResult) {
            shader.results.after(choices, op, executed, batch);
        }
        if choices.kinds.contains(&ChoiceKind::RobustTexel) {
            robust_texels::after(&shader.program, choices, op, executed, batch, bindings);
        }
    }
}
