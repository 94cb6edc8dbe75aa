//! Where something is bound: set and binding, or the name of a variable of a shader.

use std::sync::Arc;

use anyhit_engine::machine::Binding;
use anyhit_engine::module::Module;
use anyhit_engine::program::Program;
use pyo3::prelude::*;
use pyo3::types::{PyString, PyTuple};

use crate::argument::{Argument, class};
use crate::error::{invalid, invalid_type};

/// A place of a binding.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Place {
    /// Set and binding.
    At(Binding),
    /// The name of a variable, or of its block.
    Named(String),
}

/// A variable with a binding.
pub(crate) struct Variable {
    /// The name of the variable, else that of its type.
    pub(crate) name: String,
    /// The name of its block.
    pub(crate) block: String,
    /// Set and binding.
    pub(crate) binding: Binding,
}

/// The variables with a binding that entry points of a module use, in the order of their bindings.
pub(crate) fn variables(module: &Module) -> Vec<Variable> {
    let mut found: Vec<Variable> = Vec::new();
    for one in module.entry_points.iter().flat_map(|entry| module.interface_of(entry)) {
        let Some((set, binding)) = one.descriptor_set.zip(one.binding) else { continue };
        let binding = Binding { set, binding };
        let block = one.ty.map(|ty| module.describe_type(ty)).unwrap_or_default();
        let block = block.rsplit(' ').next().unwrap_or_default().to_owned();
        if !found.iter().any(|known| known.binding == binding && known.name == one.name) {
            found.push(Variable { name: one.name, block, binding });
        }
    }
    found.sort_by(|a, b| (a.binding, &a.name).cmp(&(b.binding, &b.name)));
    found
}

impl Place {
    /// The binding, in the modules of a pipeline or of a test.
    ///
    /// # Errors
    /// `InvalidArgument` with the names that there are, and for one of several bindings.
    pub(crate) fn binding<'a>(&self, modules: impl IntoIterator<Item = &'a Module>) -> PyResult<Binding> {
        let name = match self {
            Self::At(binding) => return Ok(*binding),
            Self::Named(name) => name,
        };
        let all: Vec<Variable> = modules.into_iter().flat_map(variables).collect();
        let mut found: Vec<Binding> = Vec::new();
        for one in all.iter().filter(|one| one.name == *name || one.block == *name) {
            if !found.contains(&one.binding) {
                found.push(one.binding);
            }
        }
        match found[..] {
            [binding] => Ok(binding),
            [] => {
                let mut names: Vec<String> = all.iter().map(|one| format!("`{}`", one.name)).collect();
                names.dedup();
                Err(invalid(format!(
                    "no shader uses a binding named `{name}`: the names are {}",
                    names.join(", ")
                )))
            }
            _ => {
                let places: Vec<String> =
                    found.iter().map(|at| format!("({}, {})", at.set, at.binding)).collect();
                Err(invalid(format!("`{name}` is bound at {}: write one of these", places.join(" and "))))
            }
        }
    }

    /// The binding, in the modules of programs.
    pub(crate) fn in_programs(&self, programs: &[Arc<Program>]) -> PyResult<Binding> {
        self.binding(programs.iter().map(|program| &*program.module))
    }

    /// A key of a dict: a name, `(set, binding)`, or the binding of set 0.
    pub(crate) fn of_key(key: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(pair) = key.cast::<PyTuple>() {
            if pair.len() != 2 {
                return Err(invalid(format!("a key of {} parts: write (set, binding)", pair.len())));
            }
            let set = u32::of("set", &pair.get_item(0)?)?;
            return Ok(Self::At(Binding { set, binding: u32::of("binding", &pair.get_item(1)?)? }));
        }
        match key.is_instance_of::<PyString>() {
            true => Ok(Self::Named(String::of("name", key)?)),
            false => Ok(Self::At(Binding { set: 0, binding: u32::of("binding", key)? })),
        }
    }
}

/// The place of the first arguments of a call, and the argument behind them: `(set, binding, data)`
/// or `(name, data)`.
pub(crate) fn split<'a, 'py>(
    set: &'a Bound<'py, PyAny>,
    binding: Option<&'a Bound<'py, PyAny>>,
    data: Option<&'a Bound<'py, PyAny>>,
) -> PyResult<(Place, Option<&'a Bound<'py, PyAny>>)> {
    if set.is_instance_of::<PyString>() {
        if binding.is_some() && data.is_some() {
            return Err(invalid_type("a name stands for set and binding: leave out the binding".to_owned()));
        }
        return Ok((Place::Named(String::of("name", set)?), data.or(binding)));
    }
    let number = u32::of("set", set).map_err(|error| match set.extract::<i128>() {
        Ok(_) => error,
        Err(_) => invalid_type(format!("set: expected int or the name of a binding, found {}", class(set))),
    })?;
    let Some(binding) = binding else {
        return Err(invalid_type("binding: missing after the set".to_owned()));
    };
    Ok((Place::At(Binding { set: number, binding: u32::of("binding", binding)? }), data))
}

/// As [`split`], where something follows the place.
pub(crate) fn split_with<'a, 'py>(
    name: &str,
    set: &'a Bound<'py, PyAny>,
    binding: Option<&'a Bound<'py, PyAny>>,
    data: Option<&'a Bound<'py, PyAny>>,
) -> PyResult<(Place, &'a Bound<'py, PyAny>)> {
    let (place, data) = split(set, binding, data)?;
    let data = data.ok_or_else(|| invalid_type(format!("{name}: missing behind the binding")))?;
    Ok((place, data))
}
