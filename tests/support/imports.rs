//! Which file of a crate uses names of which other file.
//!
//! A small reader of Rust: it follows `mod` declarations from the root of a crate, leaves out what
//! only tests see, and resolves the paths of imports and of code through re-exports to the file
//! that defines the name. So a module that only declares and re-exports is used by nobody.
//!
//! What a module takes from its own parts is left out, too: it is made of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The files of a crate, and what each takes from the others.
#[derive(Default)]
pub struct Imports {
    /// The files, in the order in which the crate declares them.
    pub files: Vec<String>,
    /// The names that a file, the first, takes from another.
    pub names: BTreeMap<(usize, usize), BTreeSet<String>>,
}

impl Imports {
    /// Reads the crate whose root is the file `root`; files are named from `base` on.
    pub fn of_crate(root: &Path, base: &Path) -> Self {
        let mut reader = Reader::default();
        let folder = root.parent().expect("a file in a folder");
        let mut waiting = vec![(Vec::new(), root.to_path_buf(), folder.to_path_buf())];
        while let Some((path, file, folder)) = waiting.pop() {
            let text = fs::read_to_string(&file).unwrap_or_else(|error| panic!("{file:?}: {error}"));
            let name = file.strip_prefix(base).expect("a file below the base").to_string_lossy();
            let number = reader.files.len();
            reader.files.push(normalized(&name));
            reader.homes.push(path.clone());
            let parent = file.parent().expect("a file in a folder");
            for child in reader.read(&path, number, &without_tests(tokens(&text))) {
                let child_name = child.path.last().expect("a child has a name").clone();
                let (file, inside) = match child.file {
                    Some(place) => (parent.join(&place), parent.join(place).parent().unwrap().to_path_buf()),
                    None => {
                        let inside = folder.join(&child_name);
                        let flat = folder.join(format!("{child_name}.rs"));
                        (if flat.exists() { flat } else { inside.join("mod.rs") }, inside)
                    }
                };
                waiting.push((child.path, file, inside));
            }
        }
        reader.imports()
    }

    /// The circles: sets of files that use each other's names, directly or through others of the
    /// set. Sorted, as the files of each are.
    pub fn circles(&self) -> Vec<Vec<usize>> {
        let mut tarjan = Tarjan { uses: vec![Vec::new(); self.files.len()], ..Tarjan::default() };
        for &(from, to) in self.names.keys() {
            tarjan.uses[from].push(to);
        }
        tarjan.places = vec![None; self.files.len()];
        for file in 0..self.files.len() {
            if tarjan.places[file].is_none() {
                tarjan.visit(file);
            }
        }
        for circle in &mut tarjan.circles {
            circle.sort_by_key(|&file| &self.files[file]);
        }
        tarjan.circles.sort_by_key(|circle| &self.files[circle[0]]);
        tarjan.circles
    }

    /// What ties the files of a circle, one line for each pair: `file -> file: names`.
    pub fn ties(&self, circle: &[usize]) -> String {
        let mut lines = Vec::new();
        for (&(from, to), names) in &self.names {
            if circle.contains(&from) && circle.contains(&to) {
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                lines.push(format!("  {} -> {}: {}", self.files[from], self.files[to], names.join(", ")));
            }
        }
        lines.sort();
        lines.join("\n")
    }
}

/// Tarjan's strongly connected components, those of several files.
#[derive(Default)]
struct Tarjan {
    uses: Vec<Vec<usize>>,
    /// When a file was met, and whether it is still on the stack.
    places: Vec<Option<(usize, bool)>>,
    stack: Vec<usize>,
    met: usize,
    circles: Vec<Vec<usize>>,
}

impl Tarjan {
    /// Returns the first file met that this one reaches and that is still on the stack.
    fn visit(&mut self, file: usize) -> usize {
        let number = self.met;
        self.met += 1;
        self.places[file] = Some((number, true));
        self.stack.push(file);
        let mut lowest = number;
        for at in 0..self.uses[file].len() {
            let used = self.uses[file][at];
            match self.places[used] {
                None => lowest = lowest.min(self.visit(used)),
                Some((other, true)) => lowest = lowest.min(other),
                Some((_, false)) => {}
            }
        }
        if lowest == number {
            let begin = self.stack.iter().rposition(|&on_stack| on_stack == file).expect("it was pushed");
            let circle = self.stack.split_off(begin);
            for &member in &circle {
                self.places[member].as_mut().expect("it was met").1 = false;
            }
            if circle.len() > 1 {
                self.circles.push(circle);
            }
        }
        lowest
    }
}

/// A child module that stands in a file of its own, at `file` if the declaration says so.
struct Child {
    path: Vec<String>,
    file: Option<String>,
}

/// A module: a file, or a part of one.
#[derive(Default)]
struct Module {
    file: usize,
    children: BTreeSet<String>,
    defined: BTreeSet<String>,
    /// Imported names, and the paths that they stand for.
    aliases: BTreeMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
    /// Paths in code, of one word and more.
    paths: BTreeSet<Vec<String>>,
}

/// What a path leads to.
#[derive(Clone)]
enum Place {
    Module(Vec<String>),
    /// A name that a file defines.
    Name(usize, String),
}

#[derive(Default)]
struct Reader {
    files: Vec<String>,
    /// The module that each file is.
    homes: Vec<Vec<String>>,
    modules: BTreeMap<Vec<String>, Module>,
    macros: BTreeMap<String, usize>,
}

impl Reader {
    /// Reads a module's tokens; returns its children in files of their own.
    fn read(&mut self, path: &[String], file: usize, tokens: &[Token]) -> Vec<Child> {
        let mut found = Vec::new();
        let mut module = Module { file, ..Module::default() };
        let mut depth = 0_usize;
        let mut place = None;
        let mut at = 0;
        while at < tokens.len() {
            let next = |ahead: usize| tokens.get(at + ahead);
            match &tokens[at] {
                Token::Punctuation('{') => depth += 1,
                Token::Punctuation('}') => depth = depth.saturating_sub(1),
                // `#[path = "..."]`
                Token::Word(word) if word == "path" && next(1) == Some(&Token::Punctuation('=')) => {
                    if let Some(Token::Text(text)) = next(2) {
                        place = Some(text.clone());
                    }
                }
                Token::Word(word) if word == "mod" => {
                    if let Some(Token::Word(name)) = next(1) {
                        let inner = [path, std::slice::from_ref(name)].concat();
                        module.children.insert(name.clone());
                        if next(2) == Some(&Token::Punctuation('{')) {
                            let length = group_length(&tokens[at + 2..]);
                            found.extend(self.read(&inner, file, &tokens[at + 3..at + 1 + length]));
                            at += 1 + length;
                        } else if next(2) == Some(&Token::Punctuation(';')) {
                            found.push(Child { path: inner, file: place.take() });
                        }
                    }
                }
                Token::Word(word) if word == "use" => {
                    let end = tokens[at..].iter().position(|token| *token == Token::Punctuation(';'));
                    let end = at + end.unwrap_or(tokens.len() - at);
                    read_use(&tokens[at + 1..end], &[], &mut module);
                    at = end;
                }
                Token::Word(word) if word == "macro_rules" => {
                    if let Some(Token::Word(name)) = next(2) {
                        self.macros.insert(name.clone(), file);
                    }
                    at += 2;
                }
                Token::Word(word) => {
                    const ITEMS: [&str; 8] =
                        ["fn", "struct", "enum", "trait", "const", "static", "type", "union"];
                    if let Some(Token::Word(name)) = next(1)
                        && depth == 0
                        && ITEMS.contains(&word.as_str())
                    {
                        module.defined.insert(name.clone());
                    }
                    let member = at > 0 && tokens[at - 1] == Token::Punctuation('.');
                    let mut words = vec![word.clone()];
                    while let (Some(Token::Separator), Some(Token::Word(word))) =
                        (tokens.get(at + 1), tokens.get(at + 2))
                    {
                        words.push(word.clone());
                        at += 2;
                    }
                    if !member {
                        module.paths.insert(words);
                    }
                }
                _ => {}
            }
            at += 1;
        }
        self.modules.insert(path.to_vec(), module);
        found
    }

    /// Resolves every path that was read.
    fn imports(self) -> Imports {
        let mut names: BTreeMap<(usize, usize), BTreeSet<String>> = BTreeMap::new();
        for (path, module) in &self.modules {
            let mut add = |place: Option<Place>| {
                if let Some(Place::Name(file, name)) = place
                    && file != module.file
                    && !self.homes[file].starts_with(&self.homes[module.file])
                {
                    names.entry((module.file, file)).or_default().insert(name);
                }
            };
            module.aliases.values().for_each(|words| add(self.resolve(path, words, 0)));
            for words in &module.paths {
                if words.len() > 1 {
                    add(self.resolve(path, words, 0));
                } else if !module.defined.contains(&words[0]) {
                    module.globs.iter().for_each(|glob| add(self.through_glob(path, glob, &words[0], 0)));
                }
            }
        }
        Imports { files: self.files, names }
    }

    /// What a path means in a module; nothing where it leads out of the crate.
    fn resolve(&self, module: &[String], words: &[String], steps: usize) -> Option<Place> {
        let (first, rest) = words.split_first()?;
        let begin = match first.as_str() {
            "crate" => Place::Module(Vec::new()),
            "self" => Place::Module(module.to_vec()),
            "super" => Place::Module(module.split_last()?.1.to_vec()),
            _ => self.member(module, first, rest.is_empty(), steps)?,
        };
        self.follow(begin, rest, steps)
    }

    fn follow(&self, begin: Place, words: &[String], steps: usize) -> Option<Place> {
        let mut place = begin;
        for (at, word) in words.iter().enumerate() {
            let Place::Module(module) = &place else { break };
            if word == "self" {
                continue;
            }
            if word == "super" {
                place = Place::Module(module.split_last()?.1.to_vec());
                continue;
            }
            let is_last = at + 1 == words.len();
            let found = self.member(module, word, is_last, steps);
            // What no definition names is made by a macro of the module.
            place = match found {
                Some(found) => found,
                None if module.is_empty() => return None,
                None => Place::Name(self.modules.get(module)?.file, word.clone()),
            };
        }
        Some(place)
    }

    /// What a name means in a module. As the last word of a path it is rather no module.
    fn member(&self, path: &[String], name: &str, is_last: bool, steps: usize) -> Option<Place> {
        if steps > 20 {
            return None;
        }
        let module = self.modules.get(path)?;
        let child = || {
            let child = [path, &[name.to_owned()]].concat();
            module.children.contains(name).then_some(Place::Module(child))
        };
        if !is_last && let Some(child) = child() {
            return Some(child);
        }
        if module.defined.contains(name) {
            return Some(Place::Name(module.file, name.to_owned()));
        }
        if let Some(words) = module.aliases.get(name)
            && let Some(found) = self.resolve(path, words, steps + 1)
        {
            return Some(found);
        }
        let in_globs = module.globs.iter().find_map(|glob| self.through_glob(path, glob, name, steps + 1));
        let exported = || (path.is_empty()).then(|| self.macros.get(name)).flatten();
        in_globs.or_else(child).or_else(|| exported().map(|&file| Place::Name(file, name.to_owned())))
    }

    fn through_glob(&self, path: &[String], glob: &[String], name: &str, steps: usize) -> Option<Place> {
        match self.resolve(path, glob, steps + 1)? {
            Place::Module(module) if module != path => self.member(&module, name, true, steps + 1),
            _ => None,
        }
    }
}

/// Reads the tree of an import, whose first words are `before`.
fn read_use(tokens: &[Token], before: &[String], module: &mut Module) {
    let mut words = before.to_vec();
    let mut at = 0;
    while let Some(token) = tokens.get(at) {
        match token {
            Token::Word(word) if word == "as" => {
                if let Some(Token::Word(alias)) = tokens.get(at + 1) {
                    module.aliases.insert(alias.clone(), words);
                }
                return;
            }
            Token::Word(word) => words.push(word.clone()),
            Token::Punctuation('*') => {
                module.globs.push(words);
                return;
            }
            Token::Punctuation('{') => {
                let group = &tokens[at + 1..at + group_length(&tokens[at..]) - 1];
                let mut depth = 0;
                let parts = group.split(|token| {
                    match token {
                        Token::Punctuation('{') => depth += 1,
                        Token::Punctuation('}') => depth -= 1,
                        _ => {}
                    }
                    depth == 0 && *token == Token::Punctuation(',')
                });
                parts.for_each(|part| read_use(part, &words, module));
                return;
            }
            _ => {}
        }
        at += 1;
    }
    if words.last().is_some_and(|word| word == "self") {
        words.pop();
    }
    if let Some(name) = words.last() {
        module.aliases.insert(name.clone(), words);
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Word(String),
    /// `::`
    Separator,
    /// A string.
    Text(String),
    Punctuation(char),
}

/// A text's tokens, without comments, characters, lifetimes and numbers.
fn tokens(text: &str) -> Vec<Token> {
    let characters: Vec<char> = text.chars().collect();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let starts =
        |at: usize, what: &str| what.chars().enumerate().all(|(i, c)| characters.get(at + i) == Some(&c));
    let mut found = Vec::new();
    let mut at = 0;
    while at < characters.len() {
        let c = characters[at];
        if starts(at, "//") {
            at = (at..characters.len()).find(|&i| characters[i] == '\n').unwrap_or(characters.len());
        } else if starts(at, "/*") {
            let mut depth = 0;
            loop {
                if starts(at, "/*") {
                    (depth, at) = (depth + 1, at + 2);
                } else if starts(at, "*/") {
                    (depth, at) = (depth - 1, at + 2);
                } else {
                    at += 1;
                }
                if depth == 0 || at >= characters.len() {
                    break;
                }
            }
        } else if is_word(c) {
            let end = (at..characters.len()).find(|&i| !is_word(characters[i])).unwrap_or(characters.len());
            let word: String = characters[at..end].iter().collect();
            at = end;
            let hashes = (end..characters.len()).take_while(|&i| characters[i] == '#').count();
            if ["r", "br", "cr"].contains(&word.as_str()) && characters.get(end + hashes) == Some(&'"') {
                let close = format!("\"{}", "#".repeat(hashes));
                let begin = end + hashes + 1;
                let close_at = (begin..characters.len()).find(|&i| starts(i, &close));
                let close_at = close_at.expect("a raw string ends");
                found.push(Token::Text(characters[begin..close_at].iter().collect()));
                at = close_at + close.len();
            } else if word == "r" && hashes == 1 {
                at += 1;
            } else if !c.is_numeric() {
                found.push(Token::Word(word));
            }
        } else if c == '"' {
            let mut end = at + 1;
            while characters[end] != '"' {
                end += if characters[end] == '\\' { 2 } else { 1 };
            }
            found.push(Token::Text(characters[at + 1..end].iter().collect()));
            at = end + 1;
        } else if c == '\'' {
            if starts(at + 1, "\\") {
                at = (at + 3..characters.len()).find(|&i| characters[i] == '\'').expect("a character ends")
                    + 1;
            } else if characters.get(at + 2) == Some(&'\'') {
                at += 3;
            } else {
                // A lifetime: its name is no path.
                at += 1;
                while is_word(characters[at]) {
                    at += 1;
                }
            }
        } else if starts(at, "::") {
            found.push(Token::Separator);
            at += 2;
        } else {
            if !c.is_whitespace() {
                found.push(Token::Punctuation(c));
            }
            at += 1;
        }
    }
    found
}

/// Leaves out what stands behind `#[cfg(test)]` or `#[cfg(all(test, ...))]`.
fn without_tests(tokens: Vec<Token>) -> Vec<Token> {
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if tokens[at] != Token::Punctuation('#') || tokens.get(at + 1) != Some(&Token::Punctuation('[')) {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        let end = at + 1 + group_length(&tokens[at + 1..]);
        let words: Vec<&str> = tokens[at..end]
            .iter()
            .filter_map(|token| if let Token::Word(word) = token { Some(word.as_str()) } else { None })
            .collect();
        if !matches!(words[..], ["cfg", "test", ..] | ["cfg", "all", "test", ..]) {
            kept.extend_from_slice(&tokens[at..end]);
            at = end;
            continue;
        }
        at = end;
        while tokens.get(at) == Some(&Token::Punctuation('#')) {
            at += 1 + group_length(&tokens[at + 1..]);
        }
        // To the end of the item: a semicolon, or the brace that closes its body.
        let mut is_import = false;
        while let Some(token) = tokens.get(at) {
            is_import |= matches!(token, Token::Word(word) if word == "use");
            match token {
                Token::Punctuation('{' | '(' | '[') => {
                    let is_body = *token == Token::Punctuation('{') && !is_import;
                    at += group_length(&tokens[at..]);
                    if is_body {
                        break;
                    }
                }
                Token::Punctuation(';') => {
                    at += 1;
                    break;
                }
                _ => at += 1,
            }
        }
    }
    kept
}

/// How many tokens a group has that begins with a bracket, both brackets included.
fn group_length(tokens: &[Token]) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate() {
        match token {
            Token::Punctuation('{' | '(' | '[') => depth += 1,
            Token::Punctuation('}' | ')' | ']') => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at + 1;
        }
    }
    tokens.len()
}

/// A path without `folder/../`, and with slashes.
fn normalized(path: &str) -> String {
    let mut parts = PathBuf::new();
    for part in path.replace('\\', "/").split('/') {
        if part == ".." {
            parts.pop();
        } else {
            parts.push(part);
        }
    }
    parts.to_string_lossy().replace('\\', "/")
}
