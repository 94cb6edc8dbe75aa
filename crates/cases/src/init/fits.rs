//! Which shaders fit together: those of a hit group, and those that are given what others pass.

use crate::init::{Shader, Shaders, key};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::describe_with_members;

/// More scalars are not compared.
const MAX_SCALARS: usize = 4096;

/// A variable's type, with its module.
type Declared<'a> = (&'a Module, TypeId);

impl Shader {
    /// The types of its variables of a storage class, in order.
    fn declared(&self, class: u32) -> impl Iterator<Item = Declared<'_>> {
        let variables = self.module.interface_of(&self.entry).into_iter();
        let variables = variables.filter(move |variable| variable.storage_class == class);
        variables.filter_map(|variable| Some((&*self.module, variable.ty?)))
    }

    /// What messages call it: its file, or its name in the scene.
    fn label(&self) -> String {
        format!("{} `{}`", key(self.entry.stage).replace('_', "-"), self.reference)
    }
}

/// The scalars of a type, in order: what shaders hand each other is these, whatever the structs.
fn scalars((module, ty): Declared<'_>) -> Vec<Type> {
    fn add(module: &Module, ty: TypeId, all: &mut Vec<Type>) {
        if all.len() >= MAX_SCALARS {
            return;
        }
        match module.ty(ty) {
            &Type::Vector { component: part, count } | &Type::Matrix { column: part, count } => {
                (0..count).for_each(|_| add(module, part, all));
            }
            &Type::Array { element, length, .. } => {
                let before = all.len();
                for _ in 0..module.scalar_value(length).unwrap_or(0) {
                    add(module, element, all);
                    // Empty elements add nothing, however many there are.
                    if all.len() == before || all.len() >= MAX_SCALARS {
                        break;
                    }
                }
            }
            Type::Struct { members, .. } => members.iter().for_each(|member| add(module, member.ty, all)),
            Type::Int { width, .. } => all.push(Type::Int { width: *width, signed: false }),
            // An address, wherever it leads.
            Type::Pointer { .. } => all.push(Type::Int { width: 64, signed: false }),
            scalar => all.push(scalar.clone()),
        }
    }
    let mut all = Vec::new();
    add(module, ty, &mut all);
    all
}

/// Whether two shaders declare one type in a storage class. One that declares none takes any.
fn fit(one: &Shader, other: &Shader, class: u32) -> bool {
    let first = |shader: &Shader| shader.declared(class).next().map(scalars);
    first(one).zip(first(other)).is_none_or(|(one, other)| one == other)
}

/// Whether two shaders of a hit group are given one payload, and take one kind of attributes.
fn fit_in_group(one: &Shader, other: &Shader) -> bool {
    fit(one, other, storage::INCOMING_RAY_PAYLOAD) && fit(one, other, storage::HIT_ATTRIBUTE)
}

impl Shaders {
    /// The hit groups: each closest-hit shader with the first any-hit and the first intersection
    /// shader that fit it and are in no group yet. Others are groups of their own.
    pub(super) fn groups(&self) -> Vec<Vec<&Shader>> {
        let mut groups: Vec<Vec<&Shader>> = self.of(Stage::ClosestHit).map(|shader| vec![shader]).collect();
        for stage in [Stage::AnyHit, Stage::Intersection] {
            for shader in self.of(stage) {
                let is_open = |group: &&mut Vec<&Shader>| {
                    group.iter().all(|member| member.entry.stage != stage && fit_in_group(member, shader))
                };
                match groups.iter_mut().find(is_open) {
                    Some(group) => group.push(shader),
                    None => groups.push(vec![shader]),
                }
            }
        }
        groups
    }

    /// Checks that the shaders can be called with what the others declare.
    ///
    /// # Errors
    /// `InvalidArgument` that names both types: of an any-hit shader whose payload no other shader
    /// of hits, misses or rays has, of hit attributes that are not those of an intersection shader,
    /// and of payloads or callable data that no caller passes.
    pub(super) fn check_types(&self) -> Result<()> {
        self.check_group_payloads()?;
        self.check_attributes()?;
        for (outgoing, incoming, what) in [
            (storage::RAY_PAYLOAD, storage::INCOMING_RAY_PAYLOAD, "payload"),
            (storage::CALLABLE_DATA, storage::INCOMING_CALLABLE_DATA, "callable data"),
        ] {
            self.check_passed(outgoing, incoming, what)?;
        }
        Ok(())
    }

    /// Any-hit shaders that fit no closest-hit shader must be of rays of another kind, which a miss
    /// shader or a caller shows.
    fn check_group_payloads(&self) -> Result<()> {
        let class = storage::INCOMING_RAY_PAYLOAD;
        for shader in self.of(Stage::AnyHit) {
            let Some(own) = shader.declared(class).next() else { continue };
            let mut closest = self.of(Stage::ClosestHit);
            let Some(first) = closest.find(|one| !fit(one, shader, class)) else { continue };
            let fits_another = self.of(Stage::ClosestHit).any(|one| fit(one, shader, class));
            let misses = self.of(Stage::Miss).flat_map(|one| one.declared(class));
            let passed = self.all.iter().flat_map(|one| one.declared(storage::RAY_PAYLOAD));
            let is_known = misses.chain(passed).any(|one| scalars(one) == scalars(own));
            if !fits_another && !is_known {
                return Err(mismatch("payload", [shader, first], class, class));
            }
        }
        Ok(())
    }

    /// Hit attributes are those of the intersection shader; of triangles they are two floats, of
    /// linear swept spheres one.
    fn check_attributes(&self) -> Result<()> {
        let class = storage::HIT_ATTRIBUTE;
        let reporting: Vec<&Shader> = self.of(Stage::Intersection).collect();
        for shader in &reporting {
            let hits = self.of(Stage::ClosestHit).chain(self.of(Stage::AnyHit));
            let declaring: Vec<&Shader> = hits.filter(|one| one.declared(class).next().is_some()).collect();
            let reports = shader.declared(class).next().is_some();
            if let Some(first) = declaring.first().filter(|_| reports)
                && !declaring.iter().any(|one| fit(one, shader, class))
            {
                return Err(mismatch("hit attributes", [first, shader], class, class));
            }
        }
        for stage in [Stage::AnyHit, Stage::ClosestHit] {
            for shader in self.of(stage) {
                let Some(own) = shader.declared(class).next() else { continue };
                let scalars = scalars(own);
                let are_floats = scalars.iter().all(|scalar| matches!(scalar, Type::Float { width: 32, .. }));
                let is_builtin = are_floats && scalars.len() <= 2;
                if reporting.iter().any(|one| fit(one, shader, class)) || is_builtin {
                    continue;
                }
                return Err(match reporting.first() {
                    Some(other) => mismatch("hit attributes", [shader, other], class, class),
                    None => {
                        let message =
                            format!("{}: no given shader reports its hit attributes", shader.label());
                        Error::new(ErrorKind::InvalidArgument, message)
                            .note(declaration(shader, class))
                            .note("triangles report a vec2, linear swept spheres a float")
                            .note("add the intersection shader")
                    }
                });
            }
        }
        Ok(())
    }

    /// What a shader is given must be passed by some shader, where there are any that pass
    /// something.
    fn check_passed(&self, outgoing: u32, incoming: u32, what: &str) -> Result<()> {
        let passed: Vec<(&Shader, Vec<Type>)> = self
            .all
            .iter()
            .flat_map(|shader| shader.declared(outgoing).map(move |one| (shader, scalars(one))))
            .collect();
        let Some((caller, _)) = passed.first() else { return Ok(()) };
        for shader in &self.all {
            let Some(own) = shader.declared(incoming).next().map(scalars) else { continue };
            if !passed.iter().any(|(_, one)| *one == own) {
                return Err(mismatch(what, [shader, caller], incoming, outgoing));
            }
        }
        Ok(())
    }
}

/// The error that two shaders declare different types.
fn mismatch(what: &str, [one, other]: [&Shader; 2], class: u32, other_class: u32) -> Error {
    let message = format!("{} does not fit {}: the types of their {what} differ", one.label(), other.label());
    Error::new(ErrorKind::InvalidArgument, message)
        .note(declaration(one, class))
        .note(declaration(other, other_class))
}

/// ``any-hit `any_hit` (leaf.rahit): Payload { vec3 colour }``
fn declaration(shader: &Shader, class: u32) -> String {
    let types: Vec<String> =
        shader.declared(class).map(|(module, ty)| describe_with_members(module, ty)).collect();
    let file = anyhit_engine::pipeline::source_file(&shader.module);
    format!("{}{file}: {}", shader.label(), types.join(" or "))
}
