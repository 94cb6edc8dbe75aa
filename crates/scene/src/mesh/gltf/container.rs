//! The containers of glTF: a JSON text, or a binary file of chunks (glTF 2.0, 4.4).

use serde::de::DeserializeOwned;

use crate::mesh::gltf::document::{Asset, Document, Header};
use crate::mesh::gltf::invalid;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::{InputLimit, InputLimits};

/// Bytes of the header of a binary file, and of one of its chunks.
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

const JSON: &[u8; 4] = b"JSON";
const BIN: &[u8; 4] = b"BIN\0";

/// The document of a file, and its binary chunk.
pub(super) fn parse(mut bytes: Vec<u8>, limits: &InputLimits) -> Result<(Document, Option<Vec<u8>>)> {
    if !bytes.starts_with(b"glTF") {
        return Ok((document(&bytes, limits)?, None));
    }
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
        word.map(|word| u32::from_le_bytes(word) as usize)
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(invalid("not glTF: the file ends within its header"));
    };
    if version != 2 {
        return Err(unsupported_version(&format!("the header of the binary file has version {version}")));
    }
    if length < HEADER + CHUNK_HEADER || length > bytes.len() {
        return Err(invalid(format!(
            "not glTF: the header specifies {length} bytes, but the file has {}",
            bytes.len()
        )));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = HEADER;
    // Chunks of other types belong to extensions and are skipped.
    while let (Some(size), Some(kind)) = (word(at), bytes.get(at + 4..at + CHUNK_HEADER)) {
        if at + CHUNK_HEADER > length {
            break;
        }
        let begin = at + CHUNK_HEADER;
        let end = begin.checked_add(size).filter(|end| *end <= length);
        let end =
            end.ok_or_else(|| invalid(format!("not glTF: the chunk at byte {at} ends beyond the file")))?;
        match (kind == JSON, kind == BIN) {
            (true, _) if at == HEADER => json = Some(begin..end),
            (_, true) if json.is_some() && binary.is_none() => binary = Some(begin..end),
            _ if at == HEADER => return Err(invalid("not glTF: the first chunk is not of the type JSON")),
            _ => {}
        }
        at = end;
    }
    let json = json.ok_or_else(|| invalid("not glTF: the file has no chunk of the type JSON"))?;
    let document = document(&bytes[json], limits)?;
    let chunk = binary.map(|range| {
        bytes.truncate(range.end);
        bytes.drain(..range.start);
        bytes
    });
    Ok((document, chunk))
}

fn document(text: &[u8], limits: &InputLimits) -> Result<Document> {
    // RFC 8259, section 8.1: a reader may ignore a byte order mark.
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    limits.check(InputLimit::MeshValues, json_values(text), ErrorKind::InvalidMesh)?;
    match from_json::<Document>(text) {
        Ok(document) => {
            let asset = document.asset.as_ref().ok_or_else(|| invalid("not glTF: missing field `asset`"))?;
            check_version(asset)?;
            Ok(document)
        }
        // The structure of another version is a mistake in this one: its version is what is wrong.
        Err(error) => {
            if let Ok(Header { asset }) = from_json(text) {
                check_version(&asset)?;
            }
            Err(error)
        }
    }
}

/// Reads a value; an error has the path of the property that is wrong.
fn from_json<T: DeserializeOwned>(text: &[u8]) -> Result<T> {
    let mut json = serde_json::Deserializer::from_slice(text);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let path = error.path().to_string();
        let message = error.into_inner().to_string();
        invalid(match path.as_str() {
            "." => format!("not glTF: {message}"),
            path => format!("not glTF: `{path}`: {message}"),
        })
    })?;
    json.end().map_err(|error| invalid(format!("not glTF: {error}")))?;
    Ok(value)
}

/// The number of values of a JSON text, or a few more: each begins the text, or follows a comma
/// or an opening bracket outside of strings.
fn json_values(text: &[u8]) -> u64 {
    let (mut count, mut in_string, mut escaped) = (1, false, false);
    for byte in text {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => in_string = !in_string,
            b',' | b'[' | b'{' if !in_string => count += 1,
            _ => {}
        }
    }
    count
}

/// Checks that a reader of glTF 2.0 can read a file (glTF 2.0, 3.2): minor versions are compatible
/// unless `minVersion` says otherwise.
fn check_version(asset: &Asset) -> Result<()> {
    let numbers = |key: &str, version: &str| -> Result<(u32, u32)> {
        let numbers = version
            .split_once('.')
            .and_then(|(major, minor)| Some((major.parse().ok()?, minor.parse().ok()?)));
        numbers.ok_or_else(|| {
            invalid(format!("`asset.{key}` is `{version}`, which is not a version such as `2.0`"))
        })
    };
    let (major, _) = numbers("version", &asset.version)?;
    if major != 2 {
        return Err(unsupported_version(&format!("`asset.version` is `{}`", asset.version)));
    }
    if let Some(least) = &asset.min_version
        && numbers("minVersion", least)? > (2, 0)
    {
        return Err(unsupported_version(&format!("`asset.minVersion` is `{least}`")));
    }
    Ok(())
}

fn unsupported_version(found: &str) -> Error {
    Error::new(ErrorKind::UnsupportedFile, format!("{found}, but only glTF 2.0 is read"))
        .note("help: export or convert the model as glTF 2.0")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        document(text.as_bytes(), &InputLimits::default()).unwrap_err().message().to_string()
    }

    /// glTF 2.0, 3.2; the structure of glTF 1.0 has objects in place of lists.
    #[test]
    fn versions_that_are_not_read_are_named() {
        for (text, wanted) in [
            (r#"{"asset":{"version":"1.0"},"accessors":{"a":{}}}"#, "`asset.version` is `1.0`"),
            (r#"{"asset":{"version":"3.0"}}"#, "`asset.version` is `3.0`"),
            (r#"{"asset":{"version":"2.1","minVersion":"2.1"}}"#, "`asset.minVersion` is `2.1`"),
            (r#"{"asset":{"version":"two"}}"#, "`asset.version` is `two`"),
            (r#"{"asset":{}}"#, "`asset`: missing field `version`"),
            ("{}", "missing field `asset`"),
        ] {
            assert!(message(text).contains(wanted), "{}", message(text));
        }
        for text in [
            r#"{"asset":{"version":"2.1"}}"#,
            r#"{"asset":{"version":"2.1","minVersion":"2.0"}}"#,
            "\u{feff}{\"asset\":{\"version\":\"2.0\"}}",
        ] {
            document(text.as_bytes(), &InputLimits::default()).unwrap();
        }
    }

    #[test]
    fn values_of_json_are_counted_outside_of_strings() {
        assert_eq!(json_values(br#"{"a": [1, 2], "b,[{": "c\",{"}"#), 5);
    }

    /// glTF 2.0, 4.4.3: the first chunk is JSON; chunks of unknown types are ignored.
    #[test]
    fn chunks_are_found_by_their_types() {
        let json = br#"{"asset":{"version":"2.0"}}     "#;
        let file = |version: u32, chunks: &[(&[u8; 4], &[u8])]| {
            let chunk = |(kind, data): &(&[u8; 4], &[u8])| {
                [&(data.len() as u32).to_le_bytes()[..], &kind[..], data].concat()
            };
            let body: Vec<u8> = chunks.iter().flat_map(chunk).collect();
            [b"glTF", &version.to_le_bytes()[..], &(12 + body.len() as u32).to_le_bytes(), &body].concat()
        };
        let read = |bytes: Vec<u8>| parse(bytes, &InputLimits::default());
        let (json, bin, other) = ((JSON, &json[..]), (BIN, &[1, 2, 3, 4][..]), (b"ABCD", &[9; 4][..]));
        for chunks in [&[json, bin][..], &[json, bin, other], &[json, other, bin]] {
            assert_eq!(read(file(2, chunks)).unwrap().1, Some(vec![1, 2, 3, 4]));
        }
        let trailing = [file(2, &[json, bin]), b"abcdefg".to_vec()].concat();
        assert_eq!(read(trailing).unwrap().1, Some(vec![1, 2, 3, 4]));
        assert_eq!(read(file(2, &[json, other])).unwrap().1, None);
        assert!(read(file(2, &[bin, json])).unwrap_err().message().contains("the first chunk"));
        let error = read(file(1, &[json, bin])).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::UnsupportedFile);
        assert!(error.message().contains("the header of the binary file has version 1"), "{error}");
    }

    #[test]
    fn mistakes_have_the_path_of_their_property() {
        let text =
            r#"{"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":{"POSITION":-1}}]}]}"#;
        let message = message(text);
        assert!(message.contains("`meshes[0].primitives[0].attributes.POSITION`"), "{message}");
        assert!(message.contains("line 1"), "{message}");
    }
}
