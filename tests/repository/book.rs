//! The book of `docs/` (`book.toml`): it has every page once, and every anchor that a document
//! names is there.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};

use pretty_assertions::assert_eq;

use crate::support::files::root;

const SUMMARY: &str = "docs/SUMMARY.md";

/// The pages beneath a folder, by their paths from the root.
fn pages(folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root().join(folder)).expect("a folder") {
        let entry = entry.expect("an entry");
        let name = format!("{folder}/{}", entry.file_name().into_string().expect("a plain name"));
        match entry.file_type().expect("a type").is_dir() {
            true => found.extend(pages(&name)),
            false if name.ends_with(".md") => found.push(name),
            false => {}
        }
    }
    found
}

fn read(page: &str) -> String {
    fs::read_to_string(root().join(page)).expect("a page").replace("\r\n", "\n")
}

/// The lines of a page that are not code.
fn prose(page: &str) -> Vec<String> {
    let mut inside = false;
    let mut lines = Vec::new();
    for line in read(page).lines() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
        } else if !inside {
            lines.push(line.to_owned());
        }
    }
    lines
}

/// The targets of a line's links.
fn links(line: &str) -> impl Iterator<Item = &str> {
    line.match_indices("](").filter_map(|(at, _)| line[at + 2..].split(')').next())
}

/// The path of a page that another one links to, from the root.
fn target(page: &str, link: &str) -> String {
    let mut path = PathBuf::from(page);
    path.pop();
    for part in Path::new(link).components() {
        match part {
            Component::ParentDir => drop(path.pop()),
            part => path.push(part),
        }
    }
    path.to_string_lossy().replace('\\', "/")
}

/// The anchors of a page's headings, as GitHub and mdBook name them.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut counts: BTreeMap<String, u32> = BTreeMap::new();
    let mut anchors = BTreeSet::new();
    for line in prose(page).iter().filter(|line| line.starts_with('#')) {
        let heading = line.trim_start_matches('#').trim().to_lowercase();
        let mut anchor = String::new();
        for letter in heading.chars() {
            match letter {
                ' ' => anchor.push('-'),
                letter if letter.is_alphanumeric() || "-_".contains(letter) => anchor.push(letter),
                _ => {}
            }
        }
        let count = counts.entry(anchor.clone()).or_default();
        anchors.insert(if *count == 0 { anchor } else { format!("{anchor}-{count}") });
        *count += 1;
    }
    anchors
}

#[test]
fn the_book_has_every_page_once() {
    let summary = prose(SUMMARY);
    let listed = summary.iter().flat_map(|line| links(line)).map(|link| target(SUMMARY, link));
    let mut listed: Vec<String> = listed.collect();
    listed.sort();
    let mut pages: Vec<String> = pages("docs").into_iter().filter(|page| page != SUMMARY).collect();
    pages.sort();
    assert_eq!(listed, pages);
}

#[test]
fn anchors_are_headings() {
    let beside = ["README.md", "CONTRIBUTING.md", "SECURITY.md", "python/README.md"].map(str::to_owned);
    let (mut mistakes, mut count) = (Vec::new(), 0);
    for page in pages("docs").into_iter().chain(beside) {
        for line in prose(&page) {
            for link in links(&line).filter(|link| !link.contains("://")) {
                let Some((file, anchor)) = link.split_once('#') else { continue };
                let target = if file.is_empty() { page.clone() } else { target(&page, file) };
                count += 1;
                if !target.ends_with(".md") || !anchors(&target).contains(anchor) {
                    mistakes.push(format!("{page}: {link}"));
                }
            }
        }
    }
    assert!(count > 20, "only {count} links to anchors were found");
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}
