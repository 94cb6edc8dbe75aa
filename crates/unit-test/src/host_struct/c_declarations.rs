//! Layouts of structs in C and C++ source, for 64-bit machines.
//!
//! The parser reads declarations of types and constants, and skips everything else: functions,
//! templates, variables. What it cannot lay out is an error only where a struct uses it.

use std::collections::HashMap;

use crate::host_struct::c_preprocessor::{PackedToken, apply, number, precedence, preprocess};
use crate::host_struct::math_types::{HostLanguage, math_type};
use crate::host_struct::source_file::{MAX_DEPTH, SourceFile};
use crate::host_struct::{HostType, Parts, ScalarClass};
use anyhit_base::error::{Error, ErrorKind, Result};

/// Words before a type that do not change its layout.
const QUALIFIERS: &[&str] = &[
    "const",
    "volatile",
    "mutable",
    "inline",
    "constexpr",
    "typename",
    "register",
    "restrict",
    "__restrict",
    "extern",
    "constinit",
    "thread_local",
];

/// The types and constants of a file.
pub(super) struct CDeclarations {
    file: SourceFile,
    tokens: Vec<PackedToken>,
    at: usize,
    types: HashMap<String, Result<HostType>>,
    constants: HashMap<String, i64>,
    /// Names of structs in the file's order.
    names: Vec<String>,
}

/// What stands before the names of a declaration.
struct Specifier {
    ty: Result<HostType>,
    is_static: bool,
    /// Of `alignas`, for each name.
    align: usize,
    /// A struct or union without a name was defined.
    is_nameless: bool,
    /// Some word was read.
    is_there: bool,
}

/// A declared name with its type.
struct Declared {
    name: String,
    ty: Result<HostType>,
}

/// Alignment and packing of attributes.
#[derive(Default)]
struct Attributes {
    align: usize,
    is_packed: bool,
}

impl CDeclarations {
    /// Parses the tokens of a file.
    ///
    /// # Errors
    /// `InvalidSource` where types are nested too deep.
    pub(super) fn parse(file: SourceFile) -> Result<Self> {
        let tokens = preprocess(&file)?;
        let (types, constants) = (HashMap::new(), HashMap::new());
        let mut declarations = Self { file, tokens, at: 0, types, constants, names: Vec::new() };
        while declarations.at < declarations.tokens.len() {
            let before = declarations.at;
            declarations.item(0)?;
            declarations.at = declarations.at.max(before + 1);
        }
        Ok(declarations)
    }

    /// Names of the structs.
    pub(super) fn structs(&self) -> &[String] {
        &self.names
    }

    /// The layout of a struct.
    ///
    /// # Errors
    /// `InvalidSource` with the place of what has no known layout.
    pub(super) fn layout(&self, name: &str) -> Result<HostType> {
        self.types[name].clone()
    }

    fn text(&self) -> &str {
        self.ahead(0)
    }

    fn ahead(&self, count: usize) -> &str {
        self.tokens.get(self.at + count).map_or("", |one| one.token.text.as_str())
    }

    fn is(&self, text: &str) -> bool {
        self.text() == text
    }

    fn eat(&mut self, text: &str) -> bool {
        let is_it = self.is(text);
        self.at += usize::from(is_it);
        is_it
    }

    fn is_name(&self) -> bool {
        self.tokens.get(self.at).is_some_and(|one| one.token.is_name())
    }

    fn error(&self, message: impl Into<String>) -> Error {
        self.error_at(self.at, message)
    }

    fn error_at(&self, at: usize, message: impl Into<String>) -> Error {
        let last = self.tokens.get(at).or(self.tokens.last());
        let span = last.map_or(0..0, |one| one.token.span.clone());
        Error::new(ErrorKind::InvalidSource, message).at(self.file.place(span))
    }

    /// Skips a bracketed text, the opening bracket included.
    fn skip_balanced(&mut self) {
        let mut open = 0_usize;
        while self.at < self.tokens.len() {
            match self.text() {
                "(" | "{" | "[" => open += 1,
                "[[" => open += 2,
                ")" | "}" | "]" => open = open.saturating_sub(1),
                "]]" => open = open.saturating_sub(2),
                _ => {}
            }
            self.at += 1;
            if open == 0 {
                return;
            }
        }
    }

    /// Skips template arguments, from `<` on.
    fn skip_angles(&mut self) {
        let mut open = 0_usize;
        while self.at < self.tokens.len() {
            match self.text() {
                "<" => open += 1,
                "<<" => open += 2,
                ">" => open = open.saturating_sub(1),
                ">>" => open = open.saturating_sub(2),
                "(" | "{" | "[" => {
                    self.skip_balanced();
                    continue;
                }
                ";" => return,
                _ => {}
            }
            self.at += 1;
            if open == 0 {
                return;
            }
        }
    }

    /// Skips to the end of a declaration: `;`, or the body of a function.
    fn skip_declaration(&mut self) {
        while self.at < self.tokens.len() {
            match self.text() {
                ";" => {
                    self.at += 1;
                    return;
                }
                "}" => return,
                "{" => {
                    self.skip_balanced();
                    // `: a{1}, b{2} {}` of a constructor, `= {1};`.
                    if !matches!(self.text(), "," | "{" | ";" | "=") {
                        return;
                    }
                }
                "(" | "[" | "[[" => self.skip_balanced(),
                _ => self.at += 1,
            }
        }
    }

    /// A declaration outside of structs.
    fn item(&mut self, depth: usize) -> Result<()> {
        match self.text() {
            "" | ";" | "}" | "{" => self.at += 1,
            "namespace" => {
                while !matches!(self.text(), "{" | ";" | "") {
                    self.at += 1;
                }
                self.at += 1;
            }
            "extern" if self.ahead(2) == "{" => self.at += 3,
            "template" => self.template(),
            "using" => self.using(depth)?,
            "typedef" => {
                self.at += 1;
                let specifier = self.specifier(depth)?;
                for Declared { name, ty } in self.declarators(&specifier, depth)?.unwrap_or_default() {
                    self.define(name, ty);
                }
            }
            "static_assert" | "friend" | "asm" => self.skip_declaration(),
            _ => self.variable(depth)?,
        }
        Ok(())
    }

    fn template(&mut self) {
        self.at += 1;
        if self.is("<") {
            self.skip_angles();
        }
        if matches!(self.text(), "struct" | "class" | "union") {
            let name = self.ahead(1).to_owned();
            let error =
                self.error_at(self.at + 1, format!("the layout of the template `{name}` is not known"));
            self.types.entry(name).or_insert(Err(error));
        }
        self.skip_declaration();
    }

    fn using(&mut self, depth: usize) -> Result<()> {
        if self.ahead(2) != "=" {
            self.skip_declaration();
            return Ok(());
        }
        let name = self.ahead(1).to_owned();
        self.at += 3;
        let specifier = self.specifier(depth)?;
        let ty = self.abstract_type(specifier.ty, depth)?;
        self.define(name, ty);
        self.skip_declaration();
        Ok(())
    }

    /// Pointers and lengths behind a type without a name.
    fn abstract_type(&mut self, mut ty: Result<HostType>, depth: usize) -> Result<Result<HostType>> {
        while matches!(self.text(), "*" | "&" | "&&" | "const") {
            if !self.is("const") {
                ty = Ok(address());
            }
            self.at += 1;
        }
        self.lengths(ty, depth)
    }

    /// A variable or constant, or a struct with or without variables.
    fn variable(&mut self, depth: usize) -> Result<()> {
        let start = self.at;
        let specifier = self.specifier(depth)?;
        if !specifier.is_there {
            self.skip_declaration();
            return Ok(());
        }
        // `const int N = 4;`
        if self.is_name() && self.ahead(1) == "=" {
            let name = self.text().to_owned();
            self.at += 2;
            if let Ok(value) = self.expression(1, depth) {
                self.constants.insert(name, value);
            }
        }
        self.at = self.at.max(start);
        self.skip_declaration();
        Ok(())
    }

    fn define(&mut self, name: String, ty: Result<HostType>) {
        let is_struct = ty.as_ref().is_ok_and(|ty| matches!(ty.parts, Parts::Struct(_)));
        if is_struct && !self.names.contains(&name) {
            self.names.push(name.clone());
        }
        self.types.insert(name.clone(), ty.map(|ty| ty.named(name)));
    }

    /// `[[...]]`, `alignas(...)`, `__attribute__((...))`, `__declspec(...)`.
    fn attributes(&mut self, depth: usize) -> Result<Attributes> {
        let mut found = Attributes { align: 1, is_packed: false };
        loop {
            match self.text() {
                "[[" => self.skip_balanced(),
                "alignas" | "_Alignas" if self.ahead(1) == "(" => {
                    self.at += 2;
                    let align = if let Some(ty) = self.try_type(depth)? {
                        ty?.align
                    } else {
                        usize::try_from(self.expression(1, depth)?).unwrap_or(0)
                    };
                    found.align = found.align.max(self.checked_alignment(align)?);
                    self.eat(")");
                }
                "__attribute__" | "__declspec" | "_Pragma" => {
                    let from = self.at;
                    self.at += 1;
                    self.skip_balanced();
                    let end = std::mem::replace(&mut self.at, from);
                    while self.at < end {
                        match self.text() {
                            "packed" | "__packed__" => found.is_packed = true,
                            "aligned" | "__aligned__" | "align" if self.ahead(1) == "(" => {
                                self.at += 2;
                                let align = usize::try_from(self.expression(1, depth)?).unwrap_or(0);
                                found.align = found.align.max(self.checked_alignment(align)?);
                            }
                            _ => {}
                        }
                        self.at += 1;
                    }
                }
                _ => return Ok(found),
            }
        }
    }

    fn checked_alignment(&self, align: usize) -> Result<usize> {
        match align {
            0 => Ok(1),
            _ if align.is_power_of_two() && align <= 1 << 28 => Ok(align),
            _ => Err(self.error(format!("the alignment {align} is not a power of two"))),
        }
    }

    /// A type where one begins here, and not an expression.
    fn try_type(&mut self, depth: usize) -> Result<Option<Result<HostType>>> {
        let is_type = builtin_word(self.text())
            || self.types.contains_key(self.text())
            || matches!(self.text(), "struct" | "const")
            || self.ahead(1) == "::"
            || named_type(self.text()).is_some();
        if !is_type {
            return Ok(None);
        }
        let specifier = self.specifier(depth)?;
        self.abstract_type(specifier.ty, depth).map(Some)
    }

    fn specifier(&mut self, depth: usize) -> Result<Specifier> {
        if depth > MAX_DEPTH {
            return Err(self.error("types are nested too deep"));
        }
        let start = self.at;
        let mut found = Specifier {
            ty: Err(self.error("expected a type")),
            is_static: false,
            align: 1,
            is_nameless: false,
            is_there: false,
        };
        let mut words: Vec<String> = Vec::new();
        loop {
            found.align = found.align.max(self.attributes(depth)?.align);
            let text = self.text();
            if text == "static" {
                found.is_static = true;
            } else if !QUALIFIERS.contains(&text) {
                if !builtin_word(text) {
                    break;
                }
                words.push(text.to_owned());
            }
            self.at += 1;
        }
        match self.text() {
            _ if !words.is_empty() => found.ty = self.builtin(&words, start),
            "struct" | "class" | "union" => {
                let (ty, is_nameless) = self.record(depth + 1)?;
                (found.ty, found.is_nameless) = (ty, is_nameless);
            }
            "enum" => found.ty = self.enumeration(depth)?,
            _ if self.is_name() || self.is("::") => found.ty = self.named(depth + 1)?,
            _ => {
                found.is_there = false;
                return Ok(found);
            }
        }
        found.is_there = true;
        while QUALIFIERS.contains(&self.text()) {
            self.at += 1;
        }
        Ok(found)
    }

    /// A type of several words, `unsigned long long`.
    fn builtin(&self, words: &[String], at: usize) -> Result<HostType> {
        let has = |word: &str| words.iter().any(|one| one == word);
        let longs = words.iter().filter(|word| *word == "long").count();
        let (class, size) = match () {
            () if has("float") => (ScalarClass::Float, 4),
            () if has("double") && longs == 0 => (ScalarClass::Float, 8),
            () if has("char") || has("bool") || has("_Bool") => (ScalarClass::Integer, 1),
            () if has("short") => (ScalarClass::Integer, 2),
            () if longs >= 2 => (ScalarClass::Integer, 8),
            () if has("double") || longs == 1 => {
                let message = format!("the size of `{}` differs between Windows and Linux", words.join(" "));
                return Err(self
                    .error_at(at, message)
                    .note("help: use a type of fixed width, such as `int64_t`"));
            }
            () if has("void") => return Err(self.error_at(at, "`void` has no layout")),
            () => (ScalarClass::Integer, 4),
        };
        Ok(HostType::scalar(words.join(" "), class, size))
    }

    /// A type by its name, with namespaces and template arguments.
    fn named(&mut self, depth: usize) -> Result<Result<HostType>> {
        let at = self.at;
        self.eat("::");
        let mut name = self.text().to_owned();
        self.at += 1;
        while self.is("::") {
            self.at += 1;
            name = self.text().to_owned();
            self.at += 1;
        }
        if self.is("<") {
            return self.template_type(&name, at, depth);
        }
        if let Some(known) = self.types.get(&name) {
            return Ok(known.clone());
        }
        Ok(named_type(&name).ok_or_else(|| {
            let help = format!("help: declare it in this file, as a struct or as `using {name} = float[3];`");
            self.error_at(self.at - 1, format!("the layout of the type `{name}` is not known")).note(help)
        }))
    }

    /// `std::array<T, N>`, `glm::vec<3, float>`, `glm::mat<4, 4, float>`.
    fn template_type(&mut self, name: &str, at: usize, depth: usize) -> Result<Result<HostType>> {
        let start = self.at;
        self.skip_angles();
        let end = std::mem::replace(&mut self.at, start + 1);
        // `>>` closes two lists; the outer one continues behind it.
        let (mut types, mut counts) = (Vec::new(), Vec::new());
        while self.at < end && !matches!(self.text(), ">" | ">>") {
            if let Some(ty) = self.try_type(depth)? {
                types.push(ty);
            } else {
                match self.expression(8, depth) {
                    Ok(count) => counts.push(usize::try_from(count).unwrap_or(0)),
                    Err(_) => self.at += 1,
                }
            }
            self.eat(",");
        }
        self.at = end;
        let ty = match (name, types.pop(), &counts[..]) {
            ("array", Some(ty), [count]) => ty.map(|ty| ty.array(*count)),
            ("vec", Some(ty), [count]) => ty.map(|ty| ty.array(*count)),
            ("mat", Some(ty), [columns, rows]) => ty.map(|ty| ty.array(*rows).array(*columns)),
            ("atomic", Some(ty), []) => ty,
            _ => Err(self.error_at(at, format!("the layout of the template `{name}` is not known"))),
        };
        Ok(ty.map(|ty| ty.named(name)))
    }

    fn enumeration(&mut self, depth: usize) -> Result<Result<HostType>> {
        self.at += 1;
        if matches!(self.text(), "class" | "struct") {
            self.at += 1;
        }
        self.attributes(depth)?;
        let name = self.is_name().then(|| self.text().to_owned());
        self.at += usize::from(name.is_some());
        let mut ty = Ok(HostType::scalar("enum", ScalarClass::Integer, 4));
        let is_definition = self.is(":") || self.is("{");
        if self.eat(":") {
            ty = self.specifier(depth + 1)?.ty;
        }
        if self.eat("{") {
            let mut next = 0_i64;
            while !matches!(self.text(), "}" | "") {
                let constant = self.text().to_owned();
                self.at += 1;
                self.attributes(depth)?;
                if self.eat("=") {
                    next = self.expression(1, depth).unwrap_or(next);
                }
                self.constants.insert(constant, next);
                next = next.wrapping_add(1);
                while !matches!(self.text(), "," | "}" | "") {
                    self.at += 1;
                }
                self.eat(",");
            }
            self.eat("}");
        }
        match name {
            Some(name) if is_definition => {
                self.define(name, ty.clone());
                Ok(ty)
            }
            Some(name) => Ok(self.types.get(&name).cloned().unwrap_or(ty)),
            None => Ok(ty),
        }
    }

    /// A struct, class or union, with or without its members.
    fn record(&mut self, depth: usize) -> Result<(Result<HostType>, bool)> {
        if depth > MAX_DEPTH {
            return Err(self.error("structs are nested too deep"));
        }
        let is_union = self.is("union");
        self.at += 1;
        let mut attributes = self.attributes(depth)?;
        let at = self.at;
        let mut name = String::new();
        while self.is_name() && !self.is("final") {
            name = self.text().to_owned();
            self.at += 1;
            if !self.eat("::") {
                break;
            }
        }
        self.eat("final");
        if !self.is("{") && !self.is(":") {
            // `struct Sun sun;`, or a declaration without members.
            let unknown = || Err(self.error_at(at, format!("`{name}` is declared without its members")));
            return Ok((self.types.get(&name).cloned().unwrap_or_else(unknown), false));
        }
        let mut fields: Result<Vec<(String, HostType)>> = Ok(Vec::new());
        if self.eat(":") {
            fields = self.bases(depth)?;
        }
        let pack = self.tokens.get(self.at).and_then(|one| one.pack);
        self.at += 1;
        while !matches!(self.text(), "}" | "") {
            let before = self.at;
            match self.member(&name, depth)? {
                Ok(more) => {
                    if let Ok(fields) = &mut fields {
                        fields.extend(more);
                    }
                }
                Err(error) => fields = fields.and(Err(error)),
            }
            self.at = self.at.max(before + 1);
        }
        self.eat("}");
        let behind = self.attributes(depth)?;
        attributes.align = attributes.align.max(behind.align);
        let pack = if attributes.is_packed || behind.is_packed { Some(1) } else { pack };
        let ty = fields.map(|fields| {
            let build = if is_union { HostType::c_union } else { HostType::c_struct };
            build(&name, fields, pack, attributes.align)
        });
        if name.is_empty() {
            return Ok((ty, true));
        }
        if ty.is_err() && !self.names.contains(&name) {
            self.names.push(name.clone());
        }
        self.define(name, ty.clone());
        Ok((ty, false))
    }

    /// The bases of a struct as its first fields.
    fn bases(&mut self, depth: usize) -> Result<Result<Vec<(String, HostType)>>> {
        let mut fields = Ok(Vec::new());
        while !matches!(self.text(), "{" | "") {
            if matches!(self.text(), "public" | "private" | "protected" | ",") {
                self.at += 1;
                continue;
            }
            let at = self.at;
            if self.is("virtual") {
                fields = Err(self.error("the layout of virtual bases depends on the compiler"));
                self.at += 1;
                continue;
            }
            let base = self.named(depth)?;
            self.at = self.at.max(at + 1);
            match (&mut fields, base) {
                (Ok(fields), Ok(base)) => {
                    if base.has_tail_padding() {
                        let message = format!(
                            "`{}` ends in padding: compilers differ in whether members of a derived struct use it",
                            base.name
                        );
                        return Ok(Err(self.error_at(at, message).note("help: make it a member")));
                    }
                    fields.push((String::new(), base));
                }
                (fields, Err(error)) => *fields = Err(error),
                (Err(_), Ok(_)) => {}
            }
        }
        Ok(fields)
    }

    /// The fields of one member declaration; none for functions and types.
    fn member(&mut self, record: &str, depth: usize) -> Result<Result<Vec<(String, HostType)>>> {
        match self.text() {
            "public" | "private" | "protected" if self.ahead(1) == ":" => {
                self.at += 2;
                return Ok(Ok(Vec::new()));
            }
            ";" => {
                self.at += 1;
                return Ok(Ok(Vec::new()));
            }
            "using" | "typedef" | "template" | "static_assert" | "friend" => {
                self.item(depth)?;
                return Ok(Ok(Vec::new()));
            }
            "virtual" => {
                let error =
                    self.error(format!("`{record}` has virtual functions: it starts with an address"));
                self.skip_declaration();
                return Ok(Err(error.note("help: compare a struct of plain data")));
            }
            "~" | "operator" | "explicit" => {
                self.skip_declaration();
                return Ok(Ok(Vec::new()));
            }
            text if text == record && self.ahead(1) == "(" => {
                self.skip_declaration();
                return Ok(Ok(Vec::new()));
            }
            _ => {}
        }
        let specifier = self.specifier(depth)?;
        if specifier.is_static || !specifier.is_there {
            self.skip_constant(depth);
            self.skip_declaration();
            return Ok(Ok(Vec::new()));
        }
        if self.is(";") && specifier.is_nameless {
            self.at += 1;
            return Ok(specifier.ty.map(|ty| vec![(String::new(), ty)]));
        }
        let Some(declared) = self.declarators(&specifier, depth)? else { return Ok(Ok(Vec::new())) };
        Ok(declared.into_iter().map(|Declared { name, ty }| ty.map(|ty| (name, ty))).collect())
    }

    /// `static constexpr int N = 4;` in a struct.
    fn skip_constant(&mut self, depth: usize) {
        if self.is_name() && self.ahead(1) == "=" {
            let name = self.text().to_owned();
            self.at += 2;
            if let Ok(value) = self.expression(1, depth) {
                self.constants.insert(name, value);
            }
        }
    }

    /// The names behind a specifier, up to the `;`; `None` for a function.
    fn declarators(&mut self, specifier: &Specifier, depth: usize) -> Result<Option<Vec<Declared>>> {
        let mut all = Vec::new();
        loop {
            let mut ty = specifier.ty.clone();
            while matches!(self.text(), "*" | "&" | "&&") || QUALIFIERS.contains(&self.text()) {
                if !QUALIFIERS.contains(&self.text()) {
                    ty = Ok(address());
                }
                self.at += 1;
            }
            let mut align = specifier.align.max(self.attributes(depth)?.align);
            if self.is("(") && self.ahead(1) == "*" {
                // A pointer to a function: `void (*call)(int)`.
                self.at += 2;
                ty = Ok(address());
                let name = self.text().to_owned();
                self.skip_to_end_of_declarator();
                all.push(Declared { name, ty });
            } else if self.is_name() && !self.is("operator") {
                let name = self.text().to_owned();
                let at = self.at;
                self.at += 1;
                if self.is("(") {
                    self.skip_declaration();
                    return Ok(None);
                }
                align = align.max(self.attributes(depth)?.align);
                ty = self.lengths(ty, depth)?;
                align = align.max(self.attributes(depth)?.align);
                if self.is(":") {
                    let error = self.error_at(
                        at,
                        format!("the position of the bit-field `{name}` depends on the compiler"),
                    );
                    ty = Err(error.note("help: declare the integer that holds it"));
                }
                self.skip_to_end_of_declarator();
                let ty = ty.map(|ty| if align > ty.align { HostType { align, ..ty } } else { ty });
                all.push(Declared { name, ty });
            } else {
                self.skip_declaration();
                return Ok(Some(all));
            }
            if !self.eat(",") {
                self.eat(";");
                return Ok(Some(all));
            }
        }
    }

    /// Skips an initializer, a width, the parameters of a function pointer.
    fn skip_to_end_of_declarator(&mut self) {
        while !matches!(self.text(), "," | ";" | "}" | "") {
            match self.text() {
                "(" | "{" | "[" => self.skip_balanced(),
                _ => self.at += 1,
            }
        }
    }

    /// The lengths behind a name: `[4][N]`, `[]`.
    fn lengths(&mut self, ty: Result<HostType>, depth: usize) -> Result<Result<HostType>> {
        let mut lengths = Vec::new();
        while self.is("[") && self.ahead(1) != "[" {
            self.at += 1;
            if self.eat("]") {
                lengths.push(Ok(None));
                continue;
            }
            let at = self.at;
            let length = self.expression(1, depth);
            let length = length.and_then(|length| {
                usize::try_from(length)
                    .map_err(|_| self.error_at(at, format!("{length} is not a valid array length")))
            });
            lengths.push(length.map(Some));
            while !matches!(self.text(), "]" | ";" | "") {
                self.at += 1;
            }
            self.eat("]");
        }
        let apply = |ty: HostType, length: Result<Option<usize>>| {
            Ok(match length? {
                Some(count) => ty.array(count),
                None => ty.flexible(),
            })
        };
        Ok(lengths.into_iter().rev().fold(ty, |ty, length| ty.and_then(|ty| apply(ty, length))))
    }

    /// The value of a constant expression, of operators from a precedence on.
    fn expression(&mut self, least: u8, depth: usize) -> Result<i64> {
        let mut value = self.operand(depth + 1)?;
        loop {
            let operator = self.text().to_owned();
            let Some(strength) = precedence(&operator).filter(|strength| *strength >= least) else { break };
            let at = self.at;
            self.at += 1;
            let right = self.expression(strength + 1, depth + 1)?;
            let undefined = || self.error_at(at, "the value of this expression is not defined");
            value = apply(&operator, value, right).ok_or_else(undefined)?;
        }
        Ok(value)
    }

    fn operand(&mut self, depth: usize) -> Result<i64> {
        let at = self.at;
        let unknown = |parser: &Self| {
            parser
                .error_at(at, "the value of this length is not known")
                .note("help: write a number, or declare the constant in this file")
        };
        if depth > MAX_DEPTH {
            return Err(unknown(self));
        }
        let text = self.text().to_owned();
        self.at += 1;
        match text.as_str() {
            "-" => self.operand(depth + 1)?.checked_neg().ok_or_else(|| unknown(self)),
            "+" => self.operand(depth + 1),
            "~" => Ok(!self.operand(depth + 1)?),
            "(" => {
                let value = self.expression(1, depth + 1)?;
                if self.eat(")") { Ok(value) } else { Err(unknown(self)) }
            }
            "sizeof" if self.eat("(") => {
                let ty = self.try_type(depth + 1)?.ok_or_else(|| unknown(self))??;
                self.eat(")");
                Ok(ty.size as i64)
            }
            _ => {
                let mut name = text;
                while self.is("::") {
                    self.at += 1;
                    name = self.text().to_owned();
                    self.at += 1;
                }
                let value = number(&name).or_else(|| self.constants.get(&name).copied());
                value.ok_or_else(|| unknown(self))
            }
        }
    }
}

impl HostType {
    fn has_tail_padding(&self) -> bool {
        match &self.parts {
            Parts::Struct(fields) => {
                let end = fields.iter().map(|field| field.offset + field.ty.size).max().unwrap_or(0);
                end < self.size || fields.last().is_some_and(|field| field.ty.has_tail_padding())
            }
            _ => false,
        }
    }
}

fn address() -> HostType {
    HostType::scalar("address", ScalarClass::Integer, 8)
}

fn builtin_word(text: &str) -> bool {
    ["unsigned", "signed", "short", "long", "int", "char", "float", "double", "bool", "_Bool", "void"]
        .contains(&text)
}

/// A type of the standard library or a mathematics library.
fn named_type(name: &str) -> Option<HostType> {
    let size = match name {
        "int8_t" | "uint8_t" | "byte" | "char8_t" => 1,
        "int16_t" | "uint16_t" | "char16_t" | "ushort" => 2,
        "int32_t" | "uint32_t" | "char32_t" | "uint" => 4,
        "int64_t" | "uint64_t" | "size_t" | "uintptr_t" | "intptr_t" | "ptrdiff_t" => 8,
        _ => return math_type(name, HostLanguage::C),
    };
    Some(HostType::scalar(name, ScalarClass::Integer, size))
}
