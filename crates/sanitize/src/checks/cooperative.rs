//! Products of cooperative vectors under the sanitizer.

use crate::cause::OpPlace;
use crate::checks::{bounds, contents, memory};
use crate::races::AccessKind;
use crate::report::Sink;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Bindings, Reg, ShadowRegisters};
use anyhit_engine::ops::cooperative::matrix::{MatrixAccess, owners};
use anyhit_engine::ops::cooperative::vector::MatrixStride;
use anyhit_engine::ops::cooperative::{CooperativeOp, MatrixOp, VectorProduct};

/// A cooperative operation has run.
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    op: &CooperativeOp,
) {
    match op {
        CooperativeOp::VectorProduct(product) => {
            check_product(sanitizer, batch, bindings, shadow, place, product);
        }
        CooperativeOp::Matrix(MatrixOp::Access(access)) => {
            check_access(sanitizer, batch, bindings, shadow, place, access);
        }
        CooperativeOp::Matrix(MatrixOp::Transpose(transpose)) => {
            let operand = &transpose.operand;
            for at in 0..operand.count() {
                let lanes = owners(batch, operand, at);
                let register = operand.first.plus(at);
                sanitizer.depend_in(batch, shadow, place.op, register, Sink::Subgroup, lanes);
            }
            shadow.define_span(transpose.result.first, transpose.result.count(), batch.mask);
        }
        CooperativeOp::Matrix(MatrixOp::Product(product)) => {
            // Each component of a factor counts for many invocations: the first to depend on it is
            // the operation.
            for operand in product.operands() {
                for at in 0..operand.count() {
                    let lanes = owners(batch, &operand, at);
                    let register = operand.first.plus(at);
                    sanitizer.depend_in(batch, shadow, place.op, register, Sink::Subgroup, lanes);
                }
            }
            shadow.define_span(product.result.first, product.result.count(), batch.mask);
        }
    }
}

/// A load or store of a matrix, of which each invocation accesses its own components.
fn check_access<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    access: &MatrixAccess,
) {
    memory::depend_on_location(sanitizer, batch, shadow, place.op, &access.memory);
    if let MatrixStride::Computed(stride) = access.stride {
        sanitizer.depend(batch, shadow, place.op, stride, Sink::Index);
    }
    bounds::check_buffer(sanitizer, batch, bindings, place.op, &access.memory);
    let matrix = access.matrix;
    if !access.stores {
        memory::access_buffer(sanitizer, batch, bindings, place, &access.memory, AccessKind::Load, None);
        shadow.define_span(matrix.first, matrix.count(), batch.mask);
        return;
    }
    contents::store_matrix(sanitizer, batch, bindings, access);
    for at in 0..matrix.count() {
        let lanes = owners(batch, &matrix, at);
        sanitizer.depend_in(batch, shadow, place.op, matrix.first.plus(at), Sink::Buffer, lanes);
    }
}

/// Every component of a product depends on every component of the vector and on a row of the
/// matrix, and with a bias on a component of that.
fn check_product<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    product: &VectorProduct,
) {
    let chunk = &product.matrix;
    memory::depend_on_location(sanitizer, batch, shadow, place.op, chunk);
    if let Some(stride) = product.stride_register() {
        sanitizer.depend(batch, shadow, place.op, stride, Sink::Index);
    }
    bounds::check_buffer(sanitizer, batch, bindings, place.op, chunk);
    memory::access_buffer(sanitizer, batch, bindings, place, chunk, AccessKind::Load, None);
    shadow.define_span(product.to, product.rows, batch.mask);
    let spread = |shadow: &mut ShadowRegisters<W>, from: Reg, to: Reg| {
        let lanes = shadow.undefined(from) & batch.mask;
        if !lanes.is_empty() {
            shadow.set_undefined(to, shadow.undefined(to) | lanes);
            shadow.copy_causes(to, from, lanes);
        }
    };
    for row in 0..product.rows {
        let to = product.to.plus(row);
        (0..product.input.count).for_each(|at| spread(shadow, product.input.first.plus(at), to));
        if let Some(bias) = product.bias {
            spread(shadow, bias.first.plus(row), to);
        }
    }
    contents::product(sanitizer, batch, bindings, shadow, place, product);
}
