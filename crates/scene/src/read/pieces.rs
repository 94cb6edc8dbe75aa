//! Parses large documents in pieces.
//!
//! While the `toml` crate parses a text, it keeps each token and event, and tables that take a
//! kilobyte each: 15 times the text. Scenes list hundreds of thousands of geometries and instances.
//! Such a text is cut before some of the headers `[[instance]]` and `[geometry.NAME]`, all threads
//! parse a few of its pieces at a time, and their trees are joined in order.
//!
//! If all pieces are TOML, no cut is within a string, an array or a table: the piece before it
//! would not end properly. The joined tree is then that of the whole text, unless a name is defined
//! in several pieces in another way than by these headers. Such texts, and those with mistakes, are
//! parsed as a whole.

use std::ops::Range;
use std::sync::Arc;

use crate::read::parse_table;
use crate::tree::{Toml, TomlMember, TomlNode, TreeBuilder};
use anyhit_base::error::ErrorKind;
use anyhit_base::input::{contained, threads};
use rustc_hash::FxHashSet;

/// The bytes of a piece, at least.
const PIECE: usize = 1 << 16;

/// Takes the members `geometry` and `instance` of the root table, piece by piece.
pub(super) type Take<'a> = dyn FnMut(TomlMember) + 'a;

/// The tree of a large document; `None` where it must be parsed as a whole. What is taken is left
/// empty in it. It counts only if there is a tree in the end.
pub(super) fn tree(text: &str, take: Option<&mut Take<'_>>) -> Option<TomlNode> {
    tree_of(text, PIECE, take)
}

fn tree_of(text: &str, least: usize, mut take: Option<&mut Take<'_>>) -> Option<TomlNode> {
    let pieces = cut(text, least)?;
    let mut names: FxHashSet<Arc<str>> = FxHashSet::default();
    let mut members = Vec::new();
    let mut add = |piece: TomlNode| {
        let Toml::Table(more) = piece.value else { return None };
        for mut member in more {
            if let ("geometry", Toml::Table(geometries)) = (&*member.key, &member.node.value)
                && !geometries.iter().all(|geometry| names.insert(geometry.key.clone()))
            {
                return None;
            }
            let taken = take.is_some().then(|| member.take_parts()).flatten();
            join(&mut members, member, text)?;
            if let (Some(taken), Some(take)) = (taken, &mut take) {
                take(taken);
            }
        }
        Some(())
    };
    let mut is_tree = true;
    threads::in_order(pieces.len(), &|at| parse(text, pieces[at].clone()), &mut |piece| {
        is_tree = piece.and_then(&mut add).is_some();
        is_tree
    });
    is_tree.then(|| TreeBuilder::root(members))
}

/// The ranges of the pieces, at least two. `None` also where a header may define `geometry` or
/// `instance` in another way.
fn cut(text: &str, least: usize) -> Option<Vec<Range<usize>>> {
    let (mut pieces, mut start, mut at) = (Vec::new(), 0, 0);
    if text.len() < 2 * least {
        return None;
    }
    for line in text.split_inclusive('\n') {
        let can_cut = line.starts_with("[[instance]]") || line.starts_with("[geometry.");
        if can_cut && at - start >= least {
            pieces.push(start..at);
            start = at;
        }
        if let Some(header) = line.trim_start().strip_prefix('[') {
            let name = header.trim_start_matches(['[', ' ', '\t']);
            let ends = name.strip_prefix("geometry").is_some_and(|rest| !rest.starts_with('.'));
            if ends || name.starts_with(['"', '\'']) {
                return None;
            }
        }
        at += line.len();
    }
    pieces.push(start..at);
    (pieces.len() > 1).then_some(pieces)
}

/// The tree of a piece; `None` where it has mistakes.
fn parse(text: &str, piece: Range<usize>) -> Option<TomlNode> {
    let mut builder = TreeBuilder::of_piece(piece.start);
    let tree = || {
        let (root, errors) = parse_table(&text[piece]);
        Ok(errors.is_empty().then(|| builder.tree(&root)))
    };
    contained("toml", ErrorKind::InvalidScene, tree).ok().flatten()
}

/// Adds a member of a piece to those of the pieces before.
fn join(members: &mut Vec<TomlMember>, member: TomlMember, text: &str) -> Option<()> {
    let Some(known) = members.iter_mut().find(|known| known.key == member.key) else {
        members.push(member);
        return Some(());
    };
    let behind = match (&mut known.node.value, &member.node.value) {
        (Toml::Array(_), Toml::Array(_)) if &*member.key == "instance" => ']',
        (Toml::Table(_), Toml::Table(_)) if &*member.key == "geometry" => '.',
        _ => return None,
    };
    // Keys of both must be those of headers.
    for range in [known.key_range(), member.key_range()] {
        if !text[..range.start].ends_with('[') || !text[range.end..].starts_with(behind) {
            return None;
        }
    }
    match (&mut known.node.value, member.node.value) {
        (Toml::Array(all), Toml::Array(more)) => all.extend(more),
        (Toml::Table(all), Toml::Table(more)) => all.extend(more),
        _ => return None,
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(text: &str) -> TomlNode {
        let (root, errors) = parse_table(text);
        assert!(errors.is_empty(), "{text}");
        TreeBuilder::default().tree(&root)
    }

    const HEAD: &str = "version = 1\ntitle = 'a \\n b'\n[shaders]\nmain = 'x.spv'\n";

    #[test]
    fn pieces_make_the_tree_of_the_whole() {
        let tables = "[geometry.a]\ntype = 'spheres'\nradii = [\n  0.5, # half\n  1_000,\n]\n\
            [[instance]]\ngeometry = 'a'\nmotion.translate = [1, 2.5, -3e2]\n\
            [geometry.b]\nname = \"\"\"\nx [ y\n\"\"\"\n  [geometry.b.camera]\n  eye = 0x1F\n\
            [[instance]]\r\ngeometry = ['a', 'b']\r\n[instance.motion]\nscale = 2\n\
            [geometry.c]\n[pipeline]\nmiss = { a = 1, b = [true] }\n[[instance]]\n[[pass]]\n[[pass]]\n";
        for text in [format!("{HEAD}{tables}"), tables.to_owned()] {
            for least in [1, 40, 100] {
                let found = tree_of(&text, least, None).expect(&text);
                assert_eq!(found, whole(&text), "{least}: {text}");
                // Parts that are taken and put back make the same tree.
                let mut taken: Vec<TomlMember> = Vec::new();
                let mut left = tree_of(&text, least, Some(&mut |one| taken.push(one))).expect(&text);
                let Toml::Table(members) = &mut left.value else { panic!("no table") };
                assert!(taken.len() > 2);
                taken.into_iter().for_each(|one| join(members, one, &text).expect("a part"));
                assert_eq!(left, whole(&text), "{least}: {text}");
            }
            assert!(cut(&text, 1).unwrap().len() >= 5);
        }
    }

    #[test]
    fn what_pieces_cannot_tell_is_parsed_as_a_whole() {
        let one = "[geometry.a]\nx = 1\n[[instance]]\ny = 1\n[geometry.b]\nx = 1\n[[instance]]\ny = 2\n";
        assert!(tree_of(one, 1, None).is_some());
        assert!(tree_of(one, one.len(), None).is_none(), "small");
        for (before, after) in [
            // Mistakes that show only between pieces.
            ("", "[geometry.a]\nx = 2\n"),
            ("instance = [{ y = 0 }]\n", ""),
            ("geometry = { c = { x = 1 } }\n", ""),
            ("geometry.c.x = 1\n", ""),
            ("[geometry]\n", "[geometry]\n"),
            ("[ \"geometry\" ]\n", ""),
            ("[shaders]\nx = 1\n", "[shaders]\ny = 1\n"),
            ("[[pass]]\n", "[[pass]]\n"),
            ("", "[instance.motion]\nz = 1\n[geometry.d]\n[instance.motion]\n"),
            // Headers within values, and other mistakes.
            ("x = '''\n[[instance]]\n'''\n", ""),
            ("x = [\n[[instance]]\n", "]\n"),
            ("", "x = = 1\n"),
        ] {
            assert!(tree_of(&format!("{before}{one}{after}"), 1, None).is_none(), "{before} {after}");
        }
    }
}
