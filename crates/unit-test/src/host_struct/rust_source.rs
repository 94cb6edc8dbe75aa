//! Layouts of `#[repr(C)]` structs in Rust source.

use std::collections::HashMap;

use proc_macro2::Span;
use syn::spanned::Spanned;
use syn::{Attribute, Expr, Fields, Item, Lit, Type};

use crate::host_struct::math_types::{HostLanguage, math_type};
use crate::host_struct::source_file::{MAX_DEPTH, SourceFile};
use crate::host_struct::{HostType, ScalarClass};
use anyhit_base::error::{Error, ErrorKind, Result};

/// The items of a file that may take part in a layout, by name.
pub(super) struct RustItems {
    file: SourceFile,
    items: HashMap<String, Item>,
    names: Vec<String>,
}

impl RustItems {
    /// Parses a file.
    ///
    /// # Errors
    /// `InvalidSource` where it is not Rust.
    pub(super) fn parse(file: SourceFile) -> Result<Self> {
        let parsed = syn::parse_file(&file.text)
            .map_err(|error| located(&file, error.span(), format!("invalid Rust: {error}")))?;
        let mut items = Self { file, items: HashMap::new(), names: Vec::new() };
        items.collect(parsed.items);
        Ok(items)
    }

    /// Names of the structs, in the file's order.
    pub(super) fn structs(&self) -> &[String] {
        &self.names
    }

    /// The layout of a struct.
    ///
    /// # Errors
    /// `InvalidSource` with the place of what has no known layout.
    pub(super) fn layout(&self, name: &str) -> Result<HostType> {
        let item = &self.items[name];
        self.item(item, 0)
    }

    fn collect(&mut self, items: Vec<Item>) {
        for item in items {
            let name = match &item {
                Item::Struct(item) => &item.ident,
                Item::Union(item) => &item.ident,
                Item::Enum(item) => &item.ident,
                Item::Type(item) => &item.ident,
                Item::Const(item) => &item.ident,
                Item::Mod(_) => {
                    if let Item::Mod(module) = item {
                        self.collect(module.content.map_or_else(Vec::new, |(_, items)| items));
                    }
                    continue;
                }
                _ => continue,
            };
            let name = name.to_string();
            if matches!(item, Item::Struct(_) | Item::Union(_)) {
                self.names.push(name.clone());
            }
            // Of a name in several modules, or under several `cfg`, the first counts.
            self.items.entry(name).or_insert(item);
        }
    }

    fn error(&self, at: &impl Spanned, message: impl Into<String>) -> Error {
        located(&self.file, at.span(), message.into())
    }

    fn item(&self, item: &Item, depth: usize) -> Result<HostType> {
        let (attributes, fields, generics, name) = match item {
            Item::Struct(item) => (&item.attrs, fields_of(item.fields.iter()), &item.generics, &item.ident),
            Item::Union(item) => {
                (&item.attrs, fields_of(item.fields.named.iter()), &item.generics, &item.ident)
            }
            Item::Enum(item) => return self.enumeration(item),
            Item::Type(item) => return Ok(self.ty(&item.ty, depth)?.named(item.ident.to_string())),
            _ => return Err(self.error(item, "this is not a type")),
        };
        if !generics.params.is_empty() {
            return Err(self
                .error(name, format!("the layout of the generic type `{name}` is not known"))
                .note("help: write a type without parameters"));
        }
        let repr = self.repr(attributes)?;
        if !repr.is_c && !repr.is_transparent {
            return Err(self
                .error(name, format!("`{name}` has no `#[repr(C)]`: Rust chooses the order of its fields"))
                .note("help: add `#[repr(C)]`"));
        }
        let parts = fields.into_iter().map(|(name, ty)| Ok((name, self.ty(ty, depth)?)));
        let parts = parts.collect::<Result<Vec<_>>>()?;
        let name = name.to_string();
        let align = repr.align.unwrap_or(1);
        Ok(match item {
            Item::Union(_) => HostType::c_union(&name, parts, repr.pack, align),
            _ => HostType::c_struct(&name, parts, repr.pack, align),
        })
    }

    fn enumeration(&self, item: &syn::ItemEnum) -> Result<HostType> {
        let name = item.ident.to_string();
        if item.variants.iter().any(|variant| !matches!(variant.fields, Fields::Unit)) {
            return Err(self
                .error(&item.ident, format!("`{name}` is an enum with data, which shaders do not support")));
        }
        let repr = self.repr(&item.attrs)?;
        let size = repr.integer.or(repr.is_c.then_some(4)).ok_or_else(|| {
            self.error(&item.ident, format!("`{name}` has no `#[repr(u32)]`: Rust chooses its size"))
        })?;
        Ok(HostType::scalar(name, ScalarClass::Integer, size))
    }

    fn repr(&self, attributes: &[Attribute]) -> Result<Repr> {
        let mut repr = Repr::default();
        for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("repr")) {
            let parsed = attribute.parse_nested_meta(|meta| {
                let number = || -> syn::Result<usize> {
                    let content;
                    syn::parenthesized!(content in meta.input);
                    content.parse::<syn::LitInt>()?.base10_parse()
                };
                if meta.path.is_ident("C") {
                    repr.is_c = true;
                } else if meta.path.is_ident("transparent") {
                    repr.is_transparent = true;
                } else if meta.path.is_ident("packed") {
                    repr.pack = Some(if meta.input.peek(syn::token::Paren) { number()? } else { 1 });
                } else if meta.path.is_ident("align") {
                    repr.align = Some(number()?);
                } else if let Some(name) = meta.path.get_ident() {
                    repr.integer = integer(&name.to_string()).map(|ty| ty.size());
                }
                Ok(())
            });
            parsed.map_err(|error| located(&self.file, error.span(), error.to_string()))?;
        }
        let is_power =
            |number: Option<usize>| number.is_none_or(|number| number.is_power_of_two() && number <= 1 << 29);
        if is_power(repr.align) && is_power(repr.pack) {
            return Ok(repr);
        }
        Err(self.error(&attributes[0], "an alignment must be a power of two, at most 2^29"))
    }

    fn ty(&self, ty: &Type, depth: usize) -> Result<HostType> {
        if depth > MAX_DEPTH {
            return Err(self.error(ty, "types are nested too deep, or contain themselves"));
        }
        let depth = depth + 1;
        match ty {
            Type::Paren(inner) => self.ty(&inner.elem, depth),
            Type::Group(inner) => self.ty(&inner.elem, depth),
            Type::Ptr(_) | Type::Reference(_) | Type::FnPtr(_) => {
                Ok(HostType::scalar("address", ScalarClass::Integer, 8))
            }
            Type::Tuple(tuple) if tuple.elems.is_empty() => Ok(HostType::structure("()", 0, 1, Vec::new())),
            Type::Array(array) => {
                let count = self.constant(&array.len, depth)?;
                Ok(self.ty(&array.elem, depth)?.array(count))
            }
            Type::Path(path) => self.path(ty, &path.path, depth),
            _ => Err(self.error(ty, "the layout of this type is not known")),
        }
    }

    fn path(&self, ty: &Type, path: &syn::Path, depth: usize) -> Result<HostType> {
        let Some(last) = path.segments.last() else { return Err(self.error(ty, "a type needs a name")) };
        let name = last.ident.to_string();
        let mut arguments = Vec::new();
        if let syn::PathArguments::AngleBracketed(given) = &last.arguments {
            arguments.extend(&given.args);
        }
        let first = || match arguments.first() {
            Some(syn::GenericArgument::Type(inner)) => self.ty(inner, depth),
            _ => Err(self.error(ty, "the layout of this type is not known")),
        };
        if arguments.is_empty()
            && let Some(item) = self.items.get(&name)
        {
            return self.item(item, depth);
        }
        if arguments.is_empty()
            && let Some(known) = scalar(&name).or_else(|| math_type(&name, HostLanguage::Rust))
        {
            return Ok(known);
        }
        match name.as_str() {
            "PhantomData" => Ok(HostType::structure("PhantomData", 0, 1, Vec::new())),
            "Wrapping" | "MaybeUninit" | "Cell" | "UnsafeCell" | "NonZero" | "Saturating"
            | "ManuallyDrop" => first(),
            // mint, nalgebra, cgmath: vectors over any scalar.
            _ if arguments.len() == 1 => {
                let count =
                    |prefix: &str| name.strip_prefix(prefix).and_then(|count| count.parse::<usize>().ok());
                let small = |count: &usize| (1..=4).contains(count);
                let found = ["Vector", "Point", "Matrix", "ColumnMatrix"].into_iter().find_map(|prefix| {
                    let count = count(prefix).filter(small)?;
                    Some((count, prefix.ends_with("Matrix")))
                });
                let (count, is_matrix) = found.ok_or_else(|| self.unknown(ty, &name))?;
                let column = first()?.array(count);
                Ok(if is_matrix { column.array(count) } else { column }.named(name))
            }
            _ => Err(self.unknown(ty, &name)),
        }
    }

    fn unknown(&self, ty: &Type, name: &str) -> Error {
        let help = format!("help: declare it in this file, as a struct or as `type {name} = [f32; 3];`");
        self.error(ty, format!("the layout of the type `{name}` is not known")).note(help)
    }

    /// The value of an array's length.
    fn constant(&self, expression: &Expr, depth: usize) -> Result<usize> {
        let unknown =
            || self.error(expression, "the value of this length is not known").note("help: write a number");
        if depth > MAX_DEPTH {
            return Err(unknown());
        }
        let value = match expression {
            Expr::Lit(literal) => match &literal.lit {
                Lit::Int(number) => number.base10_parse().ok(),
                _ => None,
            },
            Expr::Paren(inner) => return self.constant(&inner.expr, depth),
            Expr::Group(inner) => return self.constant(&inner.expr, depth),
            Expr::Cast(cast) => return self.constant(&cast.expr, depth),
            Expr::Path(path) => {
                match path.path.segments.last().map(|last| self.items.get(&last.ident.to_string())) {
                    Some(Some(Item::Const(item))) => return self.constant(&item.expr, depth + 1),
                    _ => None,
                }
            }
            Expr::Binary(binary) => {
                let (a, b) =
                    (self.constant(&binary.left, depth + 1)?, self.constant(&binary.right, depth + 1)?);
                match binary.op {
                    syn::BinOp::Add(_) => a.checked_add(b),
                    syn::BinOp::Sub(_) => a.checked_sub(b),
                    syn::BinOp::Mul(_) => a.checked_mul(b),
                    syn::BinOp::Div(_) => a.checked_div(b),
                    syn::BinOp::Rem(_) => a.checked_rem(b),
                    syn::BinOp::Shl(_) => u32::try_from(b).ok().and_then(|b| a.checked_shl(b)),
                    syn::BinOp::Shr(_) => u32::try_from(b).ok().and_then(|b| a.checked_shr(b)),
                    _ => None,
                }
            }
            _ => None,
        };
        value.ok_or_else(unknown)
    }
}

/// What `#[repr(...)]` says.
#[derive(Default)]
struct Repr {
    is_c: bool,
    is_transparent: bool,
    /// Bytes of the integer of an enum.
    integer: Option<usize>,
    pack: Option<usize>,
    align: Option<usize>,
}

fn fields_of<'a>(fields: impl Iterator<Item = &'a syn::Field>) -> Vec<(String, &'a Type)> {
    let named = |(index, field): (usize, &'a syn::Field)| {
        (field.ident.as_ref().map_or_else(|| index.to_string(), ToString::to_string), &field.ty)
    };
    fields.enumerate().map(named).collect()
}

fn integer(name: &str) -> Option<HostType> {
    let size = match name {
        "u8" | "i8" => 1,
        "u16" | "i16" => 2,
        "u32" | "i32" => 4,
        "u64" | "i64" | "usize" | "isize" => 8,
        "u128" | "i128" => 16,
        _ => return None,
    };
    Some(HostType::scalar(name, ScalarClass::Integer, size))
}

fn scalar(name: &str) -> Option<HostType> {
    let (class, size) = match name {
        "f32" => (ScalarClass::Float, 4),
        "f64" => (ScalarClass::Float, 8),
        "f16" | "bf16" => (ScalarClass::Float, 2),
        "bool" | "NonZeroU8" | "NonZeroI8" | "AtomicU8" | "AtomicI8" | "AtomicBool" => {
            (ScalarClass::Integer, 1)
        }
        "NonZeroU16" | "NonZeroI16" => (ScalarClass::Integer, 2),
        "char" | "NonZeroU32" | "NonZeroI32" | "AtomicU32" | "AtomicI32" => (ScalarClass::Integer, 4),
        "NonZeroU64" | "NonZeroI64" | "AtomicU64" | "AtomicI64" => (ScalarClass::Integer, 8),
        _ => return integer(name),
    };
    Some(HostType::scalar(name, class, size))
}

fn located(file: &SourceFile, span: Span, message: String) -> Error {
    let (start, end) = (span.start(), span.end());
    let start = file.byte(start.line, start.column);
    let end = file.byte(end.line, end.column).max(start);
    Error::new(ErrorKind::InvalidSource, message).at(file.place(start..end))
}
