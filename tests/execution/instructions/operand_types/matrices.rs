//! Matrices of each width of float, by exact rationals, each operation rounded.

use std::fmt::Write;

use crate::execution::instructions::operand_types::exact;
use crate::execution::instructions::operand_types::literal;
use crate::execution::instructions::operand_types::refused::not_refused;
use crate::execution::instructions::operand_types::types::{self, Kind};
use crate::execution::instructions::run::Shader;

const FLOATS: [Kind; 3] = [Kind::F16, Kind::F32, Kind::F64];

/// A matrix: its columns.
type Matrix = Vec<Vec<u64>>;

/// Numbers whose products round in each width.
fn entry(kind: Kind, at: usize) -> u64 {
    exact::of_f64(kind, [1.1, -2.3, 0.7, 3.9, -0.13, 5.7, 2.9, -1.7][at % 8])
}

fn matrix(kind: Kind, columns: usize, rows: usize, first: usize) -> Matrix {
    (0..columns)
        .map(|column| (0..rows).map(|row| entry(kind, first + column * rows + row)).collect())
        .collect()
}

fn dot(kind: Kind, a: &[u64], b: &[u64]) -> u64 {
    let products: Vec<u64> = a.iter().zip(b).map(|(&a, &b)| exact::mul(kind, a, b)).collect();
    products[1..].iter().fold(products[0], |sum, &product| exact::add(kind, sum, product))
}

fn rows_of(matrix: &Matrix) -> Matrix {
    (0..matrix[0].len()).map(|row| matrix.iter().map(|column| column[row]).collect()).collect()
}

/// The declarations of what a module calculates with, and loads of it that nothing folds.
struct Text {
    kind: Kind,
    declarations: String,
    body: String,
    results: usize,
}

impl Text {
    fn vector(&mut self, name: &str, values: &[u64]) {
        let scalar = self.kind.name();
        for (at, &value) in values.iter().enumerate() {
            let _ = writeln!(
                self.declarations,
                "%{name}_{at} = OpConstant %{scalar} {}",
                literal(self.kind, value)
            );
        }
        let parts: String = (0..values.len()).map(|at| format!(" %{name}_{at}")).collect();
        let _ =
            writeln!(self.declarations, "%c_{name} = OpConstantComposite %{scalar}{}{parts}", values.len());
        self.held(name, &format!("{scalar}{}", values.len()));
    }

    fn matrix(&mut self, name: &str, matrix: &Matrix) {
        for (at, column) in matrix.iter().enumerate() {
            self.vector(&format!("{name}{at}"), column);
        }
        let ty = format!("m{}x{}", matrix.len(), matrix[0].len());
        let parts: String = (0..matrix.len()).map(|at| format!(" %c_{name}{at}")).collect();
        let _ = writeln!(self.declarations, "%c_{name} = OpConstantComposite %{ty}{parts}");
        self.held(name, &ty);
    }

    fn held(&mut self, name: &str, ty: &str) {
        let _ = writeln!(
            self.declarations,
            "%to_{name} = OpTypePointer Private %{ty}\n%held_{name} = OpVariable %to_{name} Private"
        );
        let _ = writeln!(self.body, "OpStore %held_{name} %c_{name}\n%{name} = OpLoad %{ty} %held_{name}");
    }

    /// Compares a result with what it must be, part by part; a bit of the word says that all agree.
    fn expect(&mut self, result: &str, expected: &Matrix) {
        let at = self.results;
        self.results += 1;
        let kind = self.kind;
        let scalar = kind.name();
        let mut all = "true".to_owned();
        for (column, parts) in expected.iter().enumerate() {
            for (row, &bits) in parts.iter().enumerate() {
                let name = format!("e{at}_{column}_{row}");
                let path = if expected.len() == 1 { format!("{row}") } else { format!("{column} {row}") };
                let _ =
                    writeln!(self.declarations, "%k{name} = OpConstant %{scalar} {}", literal(kind, bits));
                let _ = writeln!(
                    self.body,
                    "%{name} = OpCompositeExtract %{scalar} %{result} {path}
                     %is{name} = OpFOrdEqual %bool %{name} %k{name}
                     %all{name} = OpLogicalAnd %bool %{all} %is{name}"
                );
                all = format!("all{name}");
            }
        }
        let _ = writeln!(self.body, "%word{at} = OpSelect %uint %{all} %u1 %u0\nout {at} %word{at}");
    }
}

#[test]
fn products_of_matrices_of_every_width() {
    for kind in FLOATS {
        let scalar = kind.name();
        let mut declarations = types::declarations();
        for columns in 2..=4 {
            for rows in 2..=4 {
                let _ = writeln!(declarations, "%m{columns}x{rows} = OpTypeMatrix %{scalar}{rows} {columns}");
            }
        }
        let mut text = Text { kind, declarations, body: String::new(), results: 0 };
        // A has 2 columns of 3, B 4 columns of 2.
        let (a, b) = (matrix(kind, 2, 3, 0), matrix(kind, 4, 2, 3));
        let (v2, v3) = (matrix(kind, 1, 2, 5).swap_remove(0), matrix(kind, 1, 3, 2).swap_remove(0));
        text.matrix("a", &a);
        text.matrix("b", &b);
        text.vector("v", &v2);
        text.vector("w", &v3);
        let _ = writeln!(
            text.body,
            "%s = OpCompositeExtract %{scalar} %v 0
             %scaled = OpMatrixTimesScalar %m2x3 %a %s
             %av = OpMatrixTimesVector %{scalar}3 %a %v
             %wa = OpVectorTimesMatrix %{scalar}2 %w %a
             %ab = OpMatrixTimesMatrix %m4x3 %a %b
             %outer = OpOuterProduct %m2x3 %w %v
             %at = OpTranspose %m3x2 %a"
        );
        let times =
            |by: u64, column: &Vec<u64>| column.iter().map(|&part| exact::mul(kind, part, by)).collect();
        let by_rows =
            |vector: &Vec<u64>| rows_of(&a).iter().map(|row| dot(kind, row, vector)).collect::<Vec<u64>>();
        text.expect("scaled", &a.iter().map(|column| times(v2[0], column)).collect());
        text.expect("av", &vec![by_rows(&v2)]);
        text.expect("wa", &vec![a.iter().map(|column| dot(kind, &v3, column)).collect()]);
        text.expect("ab", &b.iter().map(by_rows).collect());
        text.expect("outer", &v2.iter().map(|&by| times(by, &v3)).collect());
        text.expect("at", &rows_of(&a));
        let square = matrix(kind, 2, 2, 1);
        text.matrix("q", &square);
        let _ = writeln!(
            text.body,
            "%det = OpExtInst %{scalar} %glsl Determinant %q
             %det_vector = OpCompositeConstruct %{scalar}2 %det %det
             %inverse = OpExtInst %m2x2 %glsl MatrixInverse %q"
        );
        let [c0, c1] = [&square[0], &square[1]];
        let determinant = exact::sub(kind, exact::mul(kind, c0[0], c1[1]), exact::mul(kind, c1[0], c0[1]));
        let reciprocal = exact::div(kind, exact::of_f64(kind, 1.0), determinant);
        let cofactor = |bits| exact::mul(kind, bits, reciprocal);
        let minus = |bits| exact::negate(kind, bits);
        text.expect("det_vector", &vec![vec![determinant; 2]]);
        // The adjugate times the reciprocal determinant.
        text.expect(
            "inverse",
            &vec![
                vec![cofactor(c1[1]), cofactor(minus(c0[1]))],
                vec![cofactor(minus(c1[0])), cofactor(c0[0])],
            ],
        );
        let results = text.results;
        let found = Shader { declarations: &text.declarations, body: &text.body, ..Shader::default() }.run();
        for words in found {
            assert_eq!(words[..results], vec![1; results], "{scalar}");
        }
    }
}

#[test]
fn matrices_of_two_widths_are_not_multiplied() {
    let bodies: Vec<String> = [
        "%r0 = OpMatrixTimesScalar %m2 %zero_m2 %zero_half",
        "%r1 = OpMatrixTimesScalar %m2 %zero_m2 %zero_uint",
        "%r2 = OpMatrixTimesVector %float3 %zero_m2 %zero_half2",
        "%r3 = OpMatrixTimesVector %half3 %zero_m2 %zero_float2",
        "%r4 = OpMatrixTimesVector %float3 %zero_m2 %zero_float3",
        "%r5 = OpMatrixTimesVector %float2 %zero_m2 %zero_float2",
        "%r6 = OpVectorTimesMatrix %float2 %zero_float2 %zero_m2",
        "%r7 = OpVectorTimesMatrix %float2 %zero_uint3 %zero_m2",
        "%r8 = OpMatrixTimesMatrix %m2 %zero_m2 %zero_m2",
        "%r9 = OpOuterProduct %m2 %zero_half3 %zero_float2",
        "%r10 = OpOuterProduct %m2 %zero_float2 %zero_float3",
        "%r11 = OpTranspose %m2 %zero_m2",
        "%r12 = OpTranspose %float2 %zero_float2",
        "%r13 = OpExtInst %float %glsl Determinant %zero_m2",
        "%r14 = OpExtInst %double %glsl Determinant %zero_q2",
        "%r15 = OpExtInst %m2 %glsl MatrixInverse %zero_q2",
        "%r16 = OpExtInst %float %glsl Determinant %zero_float2",
        "%r17 = OpTranspose %m2 %zero_h3",
    ]
    .map(str::to_owned)
    .to_vec();
    assert_eq!(not_refused(&bodies), []);
}
