//! The JSON Schema of what a [`Parse`] type reads, found by asking its parser: it reads small
//! values, and a recorder notes which keys it requests, as which types. So there is no second list
//! of keys that could differ from the code.

use std::any::type_name;

use serde_json::json;

use crate::read::recorder::{JsonSchema, Request, SchemaProbe};
use crate::read::{Diagnostics, Document, Parse, TomlValue};
use crate::tree::{Toml, TomlNode};
use anyhit_base::sorted::{SortedMap, SortedSet, json_object};

/// How deep tables are explored of which no type is known.
const MAX_DEPTH: usize = 4;

/// One value of each type of TOML, with the name that JSON Schema has for it.
const SHAPES: [(&str, &str); 6] = [
    ("string", "'x'"),
    ("integer", "1"),
    ("number", "0.5"),
    ("boolean", "true"),
    ("array", "[]"),
    ("object", "{}"),
];

/// Arrays of which a parser that wants so many elements accepts one.
const ARRAYS: [&str; 6] = ["[1]", "[1, 1]", "[1, 1, 1]", "['x']", "[[1, 1, 1]]", "[{}]"];

/// What became of one value of a probe.
#[derive(Default)]
struct Found {
    /// Whether something of another type was expected there.
    refused: bool,
    keys: SortedMap<&'static str, Request>,
    names: Option<Vec<&'static str>>,
    /// Whether its keys are the user's names.
    is_open: bool,
}

/// A value whose parser is asked: the parser, the text around the value, and the way to it.
#[derive(Clone, Copy)]
struct Spot<'a> {
    parse: &'a dyn Fn(TomlValue<'_>),
    around: [&'a str; 2],
    path: &'a [&'a str],
}

impl Spot<'_> {
    /// Reads a value there.
    fn read(&self, value: &str) -> Found {
        let [before, after] = self.around;
        let Ok(document) = Document::parse("probe", &format!("x = {before}{value}{after}")) else {
            return Found { refused: true, ..Found::default() };
        };
        let report = Diagnostics::recording();
        let root = document.root(&report);
        let Some(whole) = root.value("x") else { return Found::default() };
        (self.parse)(whole);
        let mut path = std::iter::once("x").chain(self.path.iter().copied());
        let at = path.try_fold(document.node(), member);
        let Some(range) = at.map(TomlNode::range) else { return Found::default() };
        let mut found = Found::default();
        let Some(recorder) = report.recorder() else { return found };
        found.refused = recorder.refused.borrow().contains(&range);
        for (_, key, request) in recorder.keys.borrow().iter().filter(|(table, ..)| *table == range) {
            let known = found.keys.entry(*key).or_default();
            known.schema = known.schema.or(request.schema);
            known.required |= request.required;
        }
        for (_, names) in recorder.names.borrow().iter().filter(|(value, _)| *value == range) {
            found.names.get_or_insert_default().extend(names);
        }
        found.is_open = recorder.open.borrow().contains(&range);
        found
    }
}

/// A member of a table by its key, or an element of an array by its number.
fn member<'a>(node: &'a TomlNode, step: &str) -> Option<&'a TomlNode> {
    match &node.value {
        Toml::Table(members) => members.iter().find(|member| &*member.key == step).map(|member| &member.node),
        Toml::Array(elements) => elements.get(step.parse::<usize>().ok()?),
        _ => None,
    }
}

impl SchemaProbe {
    /// A whole document: a schema, with all definitions that it needs.
    pub fn finish(self, title: &str, root: &JsonSchema) -> JsonSchema {
        json!({
            "$schema": "http://json-schema.org/draft-07/schema#",
            "title": title,
            "allOf": [root],
            "definitions": self.definitions,
        })
    }

    /// The schema of a type whose parser is asked.
    pub fn of_parser<T: Parse>(&mut self) -> JsonSchema {
        self.defined(type_name::<T>(), &|value| drop(T::parse(value)))
    }

    /// The schema of a type, by its name, whose parser is asked.
    fn defined(&mut self, type_name: &str, parse: &dyn Fn(TomlValue<'_>)) -> JsonSchema {
        // Without the modules: `Column<InstanceColumn>` is `Column.InstanceColumn`.
        let parts = type_name.split(['<', '>', ',']).filter(|part| !part.is_empty());
        let parts: Vec<&str> = parts.map(|part| part.rsplit("::").next().unwrap_or(part).trim()).collect();
        let name = parts.join(".");
        let reference = json!({ "$ref": format!("#/definitions/{name}") });
        if !self.definitions.contains_key(&name) {
            // What refers to itself finds it.
            self.definitions.insert(name.clone(), json!(true));
            let schema = self.explored(&Spot { parse, around: ["", ""], path: &[] }, 0);
            self.definitions.insert(name, schema);
        }
        reference
    }

    /// The schema of what is read at a spot.
    fn explored(&mut self, spot: &Spot<'_>, depth: usize) -> JsonSchema {
        let names = spot.read("'x'").names;
        let is_read = |value: &&str| !spot.read(value).refused;
        let accepted: Vec<&str> = SHAPES
            .iter()
            .filter(|(shape, value)| is_read(value) || *shape == "array" && ARRAYS.iter().any(is_read))
            .map(|(shape, _)| *shape)
            .collect();
        // Nothing looks at it, or anything will do.
        if names.is_none() && accepted.len() == SHAPES.len() && spot.read("{}").keys.is_empty()
            || depth >= MAX_DEPTH
        {
            return json!(true);
        }
        let mut ways = Vec::new();
        ways.extend(names.as_ref().map(|names| json!({ "enum": names })));
        let is_scalar =
            |shape: &&str| !matches!(*shape, "array" | "object") && (*shape != "string" || names.is_none());
        let scalars: Vec<&str> = accepted.iter().copied().filter(is_scalar).collect();
        // Every integer is a number.
        let scalars: Vec<&str> =
            scalars.iter().copied().filter(|one| *one != "integer" || !scalars.contains(&"number")).collect();
        match scalars[..] {
            [] => {}
            [one] => ways.push(json!({ "type": one })),
            _ => ways.push(json!({ "type": scalars })),
        }
        if accepted.contains(&"array") {
            let (around, path) = (
                [format!("{}[", spot.around[0]), format!("]{}", spot.around[1])],
                [spot.path, &["0"]].concat(),
            );
            let element = Spot { around: [&around[0], &around[1]], path: &path, ..*spot };
            ways.push(json!({ "type": "array", "items": self.explored(&element, depth + 1) }));
        }
        if accepted.contains(&"object") {
            ways.extend(self.tables(spot, depth));
        }
        match ways.len() {
            0 => json!(true),
            1 => ways.remove(0),
            _ => json!({ "anyOf": ways }),
        }
    }

    /// The schemas of the tables that are read at a spot: one, or one for each value of the key
    /// that decides about the others.
    fn tables(&mut self, spot: &Spot<'_>, depth: usize) -> Vec<JsonSchema> {
        let (all, required) = self.keys(spot, &[], depth);
        let decides = |(key, schema): (&&'static str, &JsonSchema)| {
            let names = names_of(schema).iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
            let is_asked_first =
                required.contains(*key) || *key == "type" && spot.read("{}").keys.contains_key(key);
            (is_asked_first && names.len() > 1).then_some((*key, names))
        };
        let Some((key, names)) = all.iter().find_map(decides) else {
            let mut schema = object(&all, &required);
            if spot.read("{}").is_open {
                schema["additionalProperties"] = json!(true);
            }
            return vec![schema];
        };
        let mut variants: Vec<(Vec<String>, JsonSchema)> = Vec::new();
        for name in names {
            let (mut keys, mut required) = self.keys(spot, &[(key, format!("'{name}'"))], depth);
            keys.remove(key);
            required.insert(key);
            let schema = object(&keys, &required);
            match variants.iter_mut().find(|(_, known)| *known == schema) {
                Some((names, _)) => names.push(name),
                None => variants.push((vec![name], schema)),
            }
        }
        let with_name = |(names, mut schema): (Vec<String>, JsonSchema)| {
            schema["properties"][key] = json!({ "enum": names });
            schema
        };
        variants.into_iter().map(with_name).collect()
    }

    /// The keys that a table may have that has some already, with their schemas, and those that it
    /// must have whatever else it has. A key that is there may let others be requested.
    fn keys(
        &mut self,
        spot: &Spot<'_>,
        given: &[(&'static str, String)],
        depth: usize,
    ) -> (SortedMap<&'static str, JsonSchema>, SortedSet<&'static str>) {
        let mut known: SortedMap<&'static str, JsonSchema> = SortedMap::new();
        let mut required: Option<SortedSet<&'static str>> = None;
        let mut open = vec![given.to_vec()];
        while let Some(members) = open.pop() {
            let requests = spot.read(&table(&members)).keys;
            let needed = requests.iter().filter(|(_, request)| request.required).map(|(key, _)| *key);
            let needed: SortedSet<_> = needed.chain(members.iter().map(|(key, _)| *key)).collect();
            required =
                Some(required.map_or(needed.clone(), |all| all.intersection(&needed).copied().collect()));
            for (key, request) in requests {
                let schema = match (request.schema, known.get(key)) {
                    (Some(schema), _) => schema(self),
                    (None, Some(_)) => continue,
                    (None, None) => self.at_key(spot, &members, key, depth),
                };
                if let Some(before) = known.get_mut(key) {
                    also(before, schema);
                    continue;
                }
                if !members.iter().any(|(given, _)| *given == key) {
                    for sample in self.samples(&schema) {
                        open.push([&members[..], &[(key, sample)]].concat());
                    }
                }
                known.insert(key, schema);
            }
        }
        (known, required.unwrap_or_default())
    }

    /// The schema of a key that is read as no type.
    fn at_key(
        &mut self,
        spot: &Spot<'_>,
        members: &[(&'static str, String)],
        key: &'static str,
        depth: usize,
    ) -> JsonSchema {
        let others: Vec<_> = members.iter().filter(|(given, _)| *given != key).cloned().collect();
        for (_, value) in SHAPES {
            let with_key = [&others[..], &[(key, value.to_owned())]].concat();
            if let Some(schema) =
                spot.read(&table(&with_key)).keys.get(key).and_then(|request| request.schema)
            {
                return schema(self);
            }
        }
        let text = table(&[&others[..], &[(key, "\0".to_owned())]].concat());
        let Some((before, after)) = text.split_once('\0') else { return json!(true) };
        let around = [format!("{}{before}", spot.around[0]), format!("{after}{}", spot.around[1])];
        let path = [spot.path, &[key]].concat();
        self.explored(&Spot { around: [&around[0], &around[1]], path: &path, ..*spot }, depth + 1)
    }

    /// A value of each type that a schema allows.
    fn samples(&self, schema: &JsonSchema) -> Vec<String> {
        if let Some(ways) = schema["anyOf"].as_array() {
            return ways.iter().flat_map(|way| self.samples(way)).collect();
        }
        if let Some(name) = schema["$ref"].as_str().and_then(|path| path.rsplit('/').next()) {
            return self.definitions.get(name).map_or_else(Vec::new, |definition| self.samples(definition));
        }
        if schema.get("enum").is_some() {
            return names_of(schema).iter().map(|name| format!("'{name}'")).collect();
        }
        let types = match &schema["type"] {
            JsonSchema::String(one) => vec![one.as_str()],
            JsonSchema::Array(all) => all.iter().filter_map(JsonSchema::as_str).collect(),
            _ => Vec::new(),
        };
        let sample = |wanted: &&str| SHAPES.iter().find(|(shape, _)| shape == wanted);
        types.iter().filter_map(sample).map(|(_, value)| (*value).to_owned()).collect()
    }
}

/// Lets a schema allow what another one does: a key may be read as several types.
fn also(schema: &mut JsonSchema, other: JsonSchema) {
    // What may be anything may be this, too.
    if *schema == other || *schema == json!(true) {
        return;
    }
    match schema.get_mut("anyOf").and_then(JsonSchema::as_array_mut) {
        Some(ways) if ways.contains(&other) => {}
        Some(ways) => ways.push(other),
        None => *schema = json!({ "anyOf": [schema.take(), other] }),
    }
}

/// The names that a schema lists.
fn names_of(schema: &JsonSchema) -> Vec<&str> {
    let names = schema["enum"].as_array().into_iter().flatten();
    names.filter_map(JsonSchema::as_str).collect()
}

/// A table of TOML in one line.
fn table(members: &[(&'static str, String)]) -> String {
    let members: Vec<String> = members.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    format!("{{ {} }}", members.join(", "))
}

fn object(keys: &SortedMap<&'static str, JsonSchema>, required: &SortedSet<&str>) -> JsonSchema {
    let properties = json_object(keys.iter().map(|(key, schema)| ((*key).to_owned(), schema.clone())));
    let mut schema = json!({ "type": "object", "properties": properties, "additionalProperties": false });
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

/// The schema of a closed set of names.
pub(super) fn one_of(names: &[&str]) -> JsonSchema {
    json!({ "enum": names })
}
