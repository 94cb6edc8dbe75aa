//! The syntax of what a scene runs: `launch`, `[[dispatch]]` and `[[pass]]`.

use std::fmt;

use crate::data::DataPieces;
use crate::read::{OneOrMore, Parse, Span, Spanned, Table, TomlValue};
use crate::tree::Toml;
use anyhit_base::error::names::list_of;

/// The most invocations of a launch: `maxRayDispatchInvocationCount` is at least 2^30, and no
/// device offers more.
pub const MAX_LAUNCH: u64 = 1 << 30;

/// Reads the size of a launch, which is 1 to 2^30 invocations.
pub(super) fn launch(table: &Table<'_>) -> Option<Spanned<[u32; 3]>> {
    table.value("launch").and_then(launch_size)
}

/// Reads the size of a launch from its value.
fn launch_size(value: TomlValue<'_>) -> Option<Spanned<[u32; 3]>> {
    let Spanned { value: size, span } = sides(value)?;
    let count = size.iter().fold(1_u128, |count, side| count * u128::from(*side));
    if count == 0 || count > u128::from(MAX_LAUNCH) {
        return value.wrong(format!("a launch must have 1 to 2^30 invocations, found {count}"));
    }
    Some(Spanned { value: size, span })
}

/// Reads one to three sizes; missing ones are 1.
fn sides(value: TomlValue<'_>) -> Option<Spanned<[u32; 3]>> {
    let Spanned { value: OneOrMore(given), span } = Spanned::<OneOrMore<u32>>::parse(value)?;
    if given.is_empty() || given.len() > 3 {
        return value.wrong("expected one to three sizes: `[width, height, depth]`");
    }
    let mut size = [1; 3];
    size[..given.len()].copy_from_slice(&given);
    Some(Spanned { value: size, span })
}

/// The size of a dispatch or launch.
#[derive(Clone, Debug)]
pub enum SizeEntry {
    /// Its numbers.
    Given([u32; 3]),
    /// Three words in a buffer.
    InBuffer {
        /// The buffer's name.
        buffer: Spanned<String>,
        /// Bytes from its beginning.
        offset: Option<Spanned<u64>>,
    },
}

impl SizeEntry {
    /// Reads the size at a key: numbers, which `given` reads, or where a buffer holds them.
    fn read(
        table: &Table<'_>,
        key: &'static str,
        given: impl FnOnce(TomlValue<'_>) -> Option<[u32; 3]>,
    ) -> Option<Option<Self>> {
        let Some(value) = table.value(key) else { return Some(None) };
        if !matches!(value.toml(), Toml::Table(_)) {
            return given(value).map(|size| Some(Self::Given(size)));
        }
        let table = Table::new(value)?;
        let (buffer, offset) = (table.required("buffer"), table.optional("offset"));
        table.finish();
        Some(Some(Self::InBuffer { buffer: buffer?, offset }))
    }
}

/// A dispatch of a compute shader.
#[derive(Clone, Debug)]
pub struct DispatchEntry {
    /// The shader.
    pub shader: Spanned<String>,
    /// The number of workgroups along x, y and z.
    pub groups: SizeEntry,
    /// Push constants of its own, in place of the scene's.
    pub push_constants: Option<DataPieces>,
}

impl DispatchEntry {
    /// Reads its keys from a table that may have more; missing ones are told when it is finished.
    fn read(table: &Table<'_>) -> impl FnOnce() -> Option<Self> + use<> {
        let shader = table.required("shader");
        let groups = SizeEntry::read(table, "groups", |value| Some(sides(value)?.value));
        let push_constants = table.optional("push_constants");
        move || {
            let groups = groups?.unwrap_or(SizeEntry::Given([1; 3]));
            Some(Self { shader: shader?, groups, push_constants })
        }
    }
}

impl Parse for DispatchEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let entry = Self::read(&table);
        table.finish();
        entry()
    }
}

/// One pass of a frame.
#[derive(Clone, Debug)]
pub struct PassEntry {
    /// The span of its table.
    pub span: Span,
    /// Its name, by which commands and rays choose it.
    pub name: Option<Spanned<String>>,
    /// What it finds where a resource is bound: the name of that resource and of the other one.
    pub resources: Vec<(Spanned<String>, Spanned<String>)>,
    /// What it runs.
    pub work: PassWorkEntry,
}

/// What a pass runs.
#[derive(Clone, Debug)]
pub enum PassWorkEntry {
    /// A launch of a pipeline from one of its ray generation shaders.
    Launch {
        /// The name of `[pipelines.NAME]`; `[pipeline]` where there is none.
        pipeline: Option<Spanned<String>>,
        /// The name of the shader's record in the pipeline, or of its shader; the first where there
        /// is none.
        raygen: Option<Spanned<String>>,
        /// The size of the launch; the scene's where there is none.
        size: Option<SizeEntry>,
        /// Push constants of its own, in place of the scene's.
        push_constants: Option<DataPieces>,
    },
    /// A dispatch of a compute shader.
    Dispatch(DispatchEntry),
}

impl Parse for PassEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let launches = !table.has("shader");
        let of_a_launch = table.has("raygen") || table.has("pipeline");
        if of_a_launch && !launches || launches && table.has("groups") {
            return value.wrong(
                "a pass must be either a launch (`pipeline`, `raygen`) or a dispatch (`shader`, `groups`)",
            );
        }
        let name = table.optional("name");
        let resources = table.value("resources").map_or(Some(Vec::new()), names);
        let work = match launches {
            false => {
                let dispatch = DispatchEntry::read(&table);
                table.finish();
                PassWorkEntry::Dispatch(dispatch()?)
            }
            true => {
                let (pipeline, raygen) = (table.optional("pipeline"), table.optional("raygen"));
                let size = SizeEntry::read(&table, "launch", |value| Some(launch_size(value)?.value));
                let push_constants = table.optional("push_constants");
                table.finish();
                PassWorkEntry::Launch { pipeline, raygen, size: size?, push_constants }
            }
        };
        Some(Self { span: value.span(), name, resources: resources?, work })
    }
}

/// A table from names to names.
fn names(value: TomlValue<'_>) -> Option<Vec<(Spanned<String>, Spanned<String>)>> {
    let table = Table::new(value)?;
    table.iter().map(|(name, value)| Some((name, Spanned::parse(value)?))).collect()
}

/// A pass, by its name or by its number, counted from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PassKey(pub String);

impl PassKey {
    /// The number of the pass among those of these names.
    pub fn find<'n>(&self, mut names: impl ExactSizeIterator<Item = Option<&'n str>>) -> Option<usize> {
        let count = names.len();
        let named = names.position(|name| name == Some(&self.0));
        named.or_else(|| self.0.parse().ok().filter(|number| *number < count))
    }

    /// What the passes of these names are called, for a note.
    pub fn known<'n>(names: impl ExactSizeIterator<Item = Option<&'n str>>) -> String {
        let all: Vec<String> = names
            .enumerate()
            .map(|(at, name)| name.map_or_else(|| at.to_string(), |name| format!("{at} `{name}`")))
            .collect();
        match all.is_empty() {
            true => "the scene has no pass".to_owned(),
            false => format!("passes: {}", list_of(all.iter().map(String::as_str))),
        }
    }
}

impl fmt::Display for PassKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Parse for PassKey {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        match value.toml() {
            Toml::Integer(..) => u32::parse(value).map(|number| Self(number.to_string())),
            _ if value.text().is_some() => String::parse(value).map(Self),
            _ => value.expected("the name or number of a pass"),
        }
    }
}
