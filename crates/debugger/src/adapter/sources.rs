//! Source texts: files of the disk where they are what the modules were compiled from, else the
//! texts that the modules hold, or the disassembly of a module that tells of no source.

use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

use emmy_dap_types::requests::{ModulesArguments, SourceArguments};
use emmy_dap_types::responses::{LoadedSourcesResponse, SourceResponse};
use emmy_dap_types::types::Source;
use serde_json::{Value, json};

use crate::debugger::{Debugger, SourceMap, SourcePosition};
use anyhit_base::sorted::sort;

use super::disassembly::Listing;
use super::frames::stage_name;
use super::protocol::{Answer, Refusal, Request, body};
use super::{Adapter, Host};

/// How a client is shown a file.
#[derive(Debug)]
enum ShownAs {
    /// A file of the disk.
    Disk(PathBuf),
    /// The text that a module holds.
    Embedded,
    /// A disassembly.
    Listing(Listing),
    /// Its name is all that is known.
    Nothing,
}

/// The sources of what was launched.
#[derive(Debug)]
pub(super) struct Sources {
    map: Rc<SourceMap>,
    /// By file of the map.
    shown: Vec<ShownAs>,
}

impl Sources {
    /// The sources of a debugger's shaders. Names of files are looked for from the folder of the
    /// scene and those around it.
    pub(super) fn new(debugger: &Debugger, host: &dyn Host, scene: &Path) -> Self {
        let map = debugger.sources().clone();
        let scene = host.absolute(scene);
        let here = host.absolute(Path::new("."));
        let folders: Vec<&Path> = scene.ancestors().skip(1).chain([here.as_path()]).collect();
        let mut shown: Vec<ShownAs> = map
            .files()
            .iter()
            .map(|file| shown_as(&file.name, file.text.as_deref(), host, &folders))
            .collect();
        for sites in map.shaders().iter().filter(|sites| sites.is_disassembled) {
            if let Some(position) = sites.position(0) {
                shown[position.file as usize] = ShownAs::Listing(Listing::new(&sites.program.module));
            }
        }
        Self { map, shown }
    }

    /// A file as clients are told of it.
    pub(super) fn source(&self, file: u32) -> Source {
        let name = &self.map.files()[file as usize].name;
        let short = name.rsplit(['/', '\\']).next().unwrap_or(name).to_owned();
        let reference = Some(file as i32 + 1);
        match &self.shown[file as usize] {
            ShownAs::Disk(path) => {
                Source { name: Some(short), path: Some(path.display().to_string()), ..Source::default() }
            }
            ShownAs::Embedded => Source {
                name: Some(short),
                path: Some(name.clone()),
                source_reference: reference,
                origin: Some("the text in the module".into()),
                ..Source::default()
            },
            ShownAs::Listing(_) => Source {
                name: Some(short),
                source_reference: reference,
                origin: Some("disassembly: the module has no debug information".into()),
                ..Source::default()
            },
            ShownAs::Nothing => Source { name: Some(short), path: Some(name.clone()), ..Source::default() },
        }
    }

    /// The line of a position as it is shown: of a disassembly, that of the instruction.
    pub(super) fn shown_line(&self, position: SourcePosition) -> u32 {
        match &self.shown[position.file as usize] {
            ShownAs::Listing(listing) => listing.line_of(position.line),
            _ => position.line,
        }
    }

    /// The line of a file that a shown line stands for.
    pub(super) fn line_from(&self, file: u32, line: u32) -> u32 {
        match &self.shown[file as usize] {
            ShownAs::Listing(listing) => listing.offset_at(line),
            _ => line,
        }
    }

    /// The file with a reference.
    pub(super) fn by_reference(&self, reference: i64) -> Option<u32> {
        let file = u32::try_from(reference.checked_sub(1)?).ok()?;
        ((file as usize) < self.shown.len()).then_some(file)
    }

    /// The file that a client's path means, if it means one: a file of the disk, or the only one
    /// whose name ends so.
    pub(super) fn by_path(&self, path: &str) -> Option<u32> {
        let wanted = comparable(path);
        let is_it = |shown: &ShownAs| match shown {
            ShownAs::Disk(path) => comparable(&path.display().to_string()) == wanted,
            _ => false,
        };
        if let Some(file) = self.shown.iter().position(is_it) {
            return Some(file as u32);
        }
        let mut files: Vec<u32> = self.map.lines_of(&wanted).map(|(_, position)| position.file).collect();
        sort(&mut files);
        files.dedup();
        match files[..] {
            [file] => Some(file),
            _ => None,
        }
    }

    /// The name of a file as the debugger has it.
    pub(super) fn name(&self, file: u32) -> &str {
        &self.map.files()[file as usize].name
    }

    /// Lines with code in a file, ascending.
    pub(super) fn lines_with_code(&self, file: u32) -> Vec<u32> {
        let all = self.map.lines_of(self.name(file));
        let own = all.filter(|(_, position)| position.file == file);
        let mut lines: Vec<u32> = own.map(|(_, position)| self.shown_line(position)).collect();
        sort(&mut lines);
        lines.dedup();
        lines
    }

    fn text(&self, file: u32) -> Option<String> {
        match &self.shown[file as usize] {
            ShownAs::Listing(listing) => Some(listing.text.clone()),
            _ => self.map.files()[file as usize].text.as_deref().map(str::to_owned),
        }
    }
}

/// How a file is shown: from the disk where the same text is found there.
fn shown_as(name: &str, text: Option<&str>, host: &dyn Host, folders: &[&Path]) -> ShownAs {
    let lines = |text: &str| text.trim_end().lines().map(str::trim_end).collect::<Vec<_>>().join("\n");
    let wanted = text.map(lines);
    let candidates = folders.iter().map(|folder| folder.join(name.replace('\\', "/")));
    for path in candidates {
        if let Some(found) = host.text(&path)
            && wanted.as_ref().is_none_or(|wanted| *wanted == lines(&found))
        {
            return ShownAs::Disk(without_dots(&path));
        }
    }
    if text.is_some() { ShownAs::Embedded } else { ShownAs::Nothing }
}

/// A path without `.` and `..`, as far as that follows from its components.
fn without_dots(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if plain.file_name().is_some() => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    plain
}

/// A path as paths are compared: with `/`, without `.` and `..`, and with a small drive letter.
fn comparable(path: &str) -> String {
    let path = path.replace('\\', "/");
    let mut plain = without_dots(Path::new(&path)).display().to_string().replace('\\', "/");
    if plain.get(1..2) == Some(":") && plain.is_char_boundary(1) {
        plain[..1].make_ascii_lowercase();
    }
    plain
}

/// The path of a `file:` URI; any other text is a path already.
pub(super) fn path_of_uri(uri: &str) -> String {
    let Some(rest) = uri.strip_prefix("file://") else { return uri.to_owned() };
    // Behind the slashes may be a host's name; `/C:/a` is a path of Windows.
    let path = rest.find('/').map_or(rest, |at| &rest[at..]);
    let mut bytes = Vec::new();
    let mut left = path.as_bytes();
    while let [first, after @ ..] = left {
        let digits = after.get(..2).filter(|_| *first == b'%').and_then(|two| std::str::from_utf8(two).ok());
        match digits.and_then(|two| u8::from_str_radix(two, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                left = &after[2..];
            }
            None => {
                bytes.push(*first);
                left = after;
            }
        }
    }
    let path = String::from_utf8_lossy(&bytes).into_owned();
    match path.strip_prefix('/').filter(|rest| rest.get(1..2) == Some(":")) {
        Some(of_drive) => of_drive.to_owned(),
        None => path,
    }
}

impl Adapter {
    pub(super) fn source(&mut self, request: &Request) -> Answer {
        let arguments: SourceArguments = request.arguments()?;
        let inner = arguments.source.and_then(|source| source.source_reference).map(i64::from);
        let reference = inner.filter(|&reference| reference > 0).unwrap_or(arguments.source_reference);
        let sources = &self.launched()?.sources;
        let file = sources.by_reference(reference);
        let text = file.and_then(|file| sources.text(file));
        let Some(content) = text else {
            return Err(Refusal::new(format!("no source has the reference {reference}")));
        };
        body(SourceResponse { content, mime_type: None })
    }

    pub(super) fn loaded_sources(&mut self) -> Answer {
        let sources = &self.launched()?.sources;
        let all = (0..sources.shown.len() as u32).map(|file| sources.source(file)).collect();
        body(LoadedSourcesResponse { sources: all })
    }

    /// The shaders of the pipeline.
    pub(super) fn modules(&mut self, request: &Request) -> Answer {
        let arguments: ModulesArguments = request.arguments()?;
        let launched = self.launched()?;
        let shaders = launched.console.debugger.sources().shaders().iter().enumerate();
        let modules = shaders.map(|(id, sites)| {
            let name = format!("{} [{}]", sites.program.name, stage_name(sites.program.stage));
            let status = if sites.is_disassembled { "no debug information" } else { "lines and names" };
            json!({ "id": id, "name": name, "symbolStatus": status, "isOptimized": false })
        });
        let all: Vec<Value> = modules.collect();
        let total = all.len();
        let first = arguments.start_module.map_or(0, |first| usize::try_from(first).unwrap_or(0));
        let count = arguments.module_count.filter(|&count| count > 0);
        let count = count.map_or(usize::MAX, |count| usize::try_from(count).unwrap_or(usize::MAX));
        let these: Vec<Value> = all.into_iter().skip(first).take(count).collect();
        Ok(json!({ "modules": these, "totalModules": total }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_of_several_editors_are_compared() {
        assert_eq!(comparable("C:\\work\\a.rgen"), comparable("c:/work/./b/../a.rgen"));
        assert_ne!(comparable("/work/a.rgen"), comparable("/work/A.rgen"));
        assert_eq!(comparable("é:/x"), "é:/x");
        assert_eq!(path_of_uri("file:///C%3A/my%20shaders/a.rgen"), "C:/my shaders/a.rgen");
        assert_eq!(path_of_uri("file:///home/a%zz%"), "/home/a%zz%");
        assert_eq!(path_of_uri("/home/a"), "/home/a");
        // A letter of two bytes in front of a colon is no drive.
        assert_eq!(path_of_uri("file://\u{e9}:a"), "\u{e9}:a");
        assert_eq!(path_of_uri("file:///%C3%A9:/a"), "/\u{e9}:/a");
    }
}
