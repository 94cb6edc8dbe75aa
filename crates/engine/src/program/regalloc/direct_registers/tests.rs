use super::*;

#[test]
fn long_programs_have_few_extended_registers() {
    for name in ["arithmetic.rgen", "light.rchit", "heavy.rchit"] {
        let path =
            format!("{}/spirv-fixtures/bench/{name}.spv", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        let module = crate::module::Module::open(path).expect("a valid fixture");
        let program = Program::of(&module, "main").expect("a supported fixture");
        assert!(
            program.register_count as usize > DIRECT_REGISTERS,
            "{name} has {} registers",
            program.register_count
        );
        let is_extended = |op: &&Op| match op {
            Op::LaneKernel { kernel, to, from } => {
                let operands = from.iter().zip(&kernel.operands).filter(|(_, words)| **words > 0);
                let mut named = operands.map(|(reg, _)| reg).chain([to]);
                named.any(|reg| reg.0 as usize >= DIRECT_REGISTERS)
            }
            _ => false,
        };
        let ops = &program.optimized.ops;
        let count = ops.iter().filter(is_extended).count();
        assert!(count * 8 <= ops.len(), "{name}: {count} of {} name extended registers", ops.len());
    }
}

#[test]
fn a_direct_constant_has_a_register_that_is_not_zeroed() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../spirv-fixtures/bench/arithmetic.rgen.spv");
    let module = crate::module::Module::open(path).expect("a valid fixture");
    let mut program = Program::of(&module, "main").expect("a supported fixture");
    let extended = Reg(DIRECT_REGISTERS as u32 + 40);
    program.variables = vec![(Reg(10), 1)];
    program.constants = vec![(extended, 7)];
    let kernel = crate::ops::arithmetic::IAdd.kernel(32).expect("a kernel of 32 bits");
    let mut ops = [Op::LaneKernel { kernel, to: Reg(0), from: [Reg(1), extended, Reg(1)] }];
    rename_constants(&mut program, &mut ops, &RegisterPool::new(400, vec![Reg(10), Reg(11)]), &[]);
    assert_eq!(ops, [Op::LaneKernel { kernel, to: Reg(0), from: [Reg(1), Reg(11), Reg(1)] }]);
    assert_eq!(program.constants, [(extended, 7), (Reg(11), 7)]);
}
