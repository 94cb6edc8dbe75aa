//! Finds what of a WGSL source naga's writer panics at: parts of the module are taken out until it
//! no longer does.

use naga::{Arena, Block, Function, Module, Span, UniqueArena};

/// The place of the part without which nothing panics; `None` where that is not in the source.
pub(super) fn find(module: &Module, panics: &dyn Fn(&Module) -> bool) -> Option<Span> {
    let mut declarations = module.clone();
    for function in functions(&mut declarations) {
        function.body = Block::new();
    }
    if !panics(&declarations) {
        return in_functions(module, panics);
    }
    // Without functions, as few types and variables as panic.
    declarations.functions.clear();
    declarations.entry_points.clear();
    let span = last_of(declarations.global_variables.len(), &|count| {
        let mut fewer = declarations.clone();
        fewer.global_variables = Arena::default();
        for (handle, variable) in declarations.global_variables.iter().take(count) {
            fewer.global_variables.append(variable.clone(), declarations.global_variables.get_span(handle));
        }
        panics(&fewer)
    });
    if let Some(at) = span {
        let (handle, _) = declarations.global_variables.iter().nth(at)?;
        return defined(declarations.global_variables.get_span(handle));
    }
    declarations.global_variables = Arena::default();
    let at = last_of(declarations.types.len(), &|count| {
        let mut fewer = declarations.clone();
        fewer.types = UniqueArena::default();
        for (handle, ty) in declarations.types.iter().take(count) {
            fewer.types.insert(ty.clone(), declarations.types.get_span(handle));
        }
        panics(&fewer)
    })?;
    let (handle, _) = declarations.types.iter().nth(at)?;
    // Types without a name have no place; a variable of one has.
    let of_variable = module.global_variables.iter().find(|(_, variable)| variable.ty == handle);
    defined(module.types.get_span(handle))
        .or_else(|| defined(module.global_variables.get_span(of_variable?.0)))
}

/// The statement that panics, in the first function whose body does.
fn in_functions(module: &Module, panics: &dyn Fn(&Module) -> bool) -> Option<Span> {
    let mut rest = module.clone();
    let count = functions(&mut rest).count();
    for number in 0..count {
        let mut one = module.clone();
        for (other, function) in functions(&mut one).enumerate() {
            if other != number {
                function.body = Block::new();
            }
        }
        if !panics(&one) {
            continue;
        }
        let whole = functions(&mut one).nth(number)?.body.clone();
        let at = last_of(whole.len(), &|count| {
            let mut fewer = one.clone();
            if let Some(function) = functions(&mut fewer).nth(number) {
                function.body.cull(count..);
            }
            panics(&fewer)
        })?;
        return whole.span_iter().nth(at).and_then(|(_, span)| defined(*span));
    }
    None
}

fn functions(module: &mut Module) -> impl Iterator<Item = &mut Function> {
    let Module { functions, entry_points, .. } = module;
    let entries = entry_points.iter_mut().map(|entry| &mut entry.function);
    functions.iter_mut().map(|(_, function)| function).chain(entries)
}

/// The last element of the shortest beginning of a list that panics; `None` where none is needed,
/// or where all of them do not.
fn last_of(count: usize, panics: &dyn Fn(usize) -> bool) -> Option<usize> {
    if panics(0) {
        return None;
    }
    (1..=count).find(|&count| panics(count)).map(|count| count - 1)
}

fn defined(span: Span) -> Option<Span> {
    (span != Span::UNDEFINED).then_some(span)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "@group(0) @binding(0) var<storage, read_write> out: array<f32>;\n\
        fn first() { out[0] = 1.0; }\n\
        @compute @workgroup_size(1) fn main() {\n    out[1] = 2.0;\n    workgroupBarrier();\n    first();\n}\n";

    fn line_of(panics: &dyn Fn(&Module) -> bool) -> Option<u32> {
        let module = naga::front::wgsl::parse_str(TEXT).unwrap();
        find(&module, panics).map(|span| span.location(TEXT).line_number)
    }

    fn bodies(module: &Module) -> Vec<Block> {
        functions(&mut module.clone()).map(|function| function.body.clone()).collect()
    }

    #[test]
    fn a_statement_is_found_in_its_function() {
        let is_barrier =
            |statement: &naga::Statement| matches!(statement, naga::Statement::ControlBarrier(_));
        assert_eq!(line_of(&|module| bodies(module).iter().any(|body| body.iter().any(is_barrier))), Some(5));
        let is_store = |statement: &naga::Statement| matches!(statement, naga::Statement::Store { .. });
        assert_eq!(line_of(&|module| bodies(module)[0].iter().any(is_store)), Some(2));
    }

    #[test]
    fn a_variable_is_found_and_a_module_without_a_cause_is_not() {
        assert_eq!(line_of(&|module| !module.global_variables.is_empty()), Some(1));
        assert_eq!(line_of(&|_| true), None);
        assert_eq!(line_of(&|_| false), None);
    }
}
