//! The URIs of glTF files: data, and names of files.

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use crate::mesh::invalid;
use anyhit_base::error::{Error, ErrorKind, Result};

/// A URI (RFC 3986) that is read.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Uri {
    /// The bytes of a data URI (RFC 2397).
    Data(Vec<u8>),
    /// The decoded name of a file, relative to the one that names it.
    File(String),
}

impl Uri {
    /// Reads a URI.
    ///
    /// # Errors
    /// `InvalidMesh` for a broken one; `UnsupportedFile` for one of another scheme.
    pub(super) fn parse(uri: &str) -> Result<Self> {
        match scheme(uri) {
            Some((scheme, data)) if scheme.eq_ignore_ascii_case("data") => data_uri(data).map(Self::Data),
            Some((scheme, _)) => {
                let message = format!("URIs of the scheme `{}:` are not read", scheme.to_ascii_lowercase());
                Err(Error::new(ErrorKind::UnsupportedFile, message)
                    .note("help: put the file beside the model and name it by a relative path"))
            }
            None => match percent_decoded(uri).and_then(|bytes| String::from_utf8(bytes).ok()) {
                Some(name) if !name.is_empty() => Ok(Self::File(name)),
                _ => Err(invalid(format!("invalid URI `{uri}`"))),
            },
        }
    }
}

/// The scheme of a URI and what follows its colon. A single letter is a drive of Windows.
fn scheme(uri: &str) -> Option<(&str, &str)> {
    let (scheme, rest) = uri.split_once(':')?;
    let is_scheme = scheme.len() > 1
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_scheme.then_some((scheme, rest))
}

/// The bytes of a data URI behind its scheme.
fn data_uri(data: &str) -> Result<Vec<u8>> {
    let Some((media_type, data)) = data.split_once(',') else {
        return Err(invalid("a data URI has no comma before its data"));
    };
    let bytes = percent_decoded(data).ok_or_else(|| invalid("a data URI has an invalid percent-encoding"))?;
    match media_type.rsplit_once(';') {
        Some((_, last)) if last.eq_ignore_ascii_case("base64") => {
            BASE64.decode(bytes).map_err(|_| invalid("a data URI contains invalid base64"))
        }
        _ => Ok(bytes),
    }
}

/// Base64 (RFC 4648, section 4), with or without padding. Bits behind the last byte may be set.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Decodes the bytes that are written as `%` and two hexadecimal digits.
fn percent_decoded(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        if byte != b'%' {
            bytes.push(byte);
            continue;
        }
        let digit = |byte: Option<u8>| (byte? as char).to_digit(16);
        bytes.push((digit(rest.next())? * 16 + digit(rest.next())?) as u8);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 4648, section 10, with and without padding.
    #[test]
    fn data_uris_contain_base64() {
        let parse = |text: &str| Uri::parse(&format!("data:;base64,{text}"));
        for (text, plain) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg", "foob"),
            ("Zm9vYmFy", "foobar"),
            // Bits behind the last byte.
            ("Zn==", "f"),
        ] {
            assert_eq!(parse(text).unwrap(), Uri::Data(plain.as_bytes().to_vec()), "{text}");
        }
        for text in ["Z", "Z!==", "Z m8", "Zm8_"] {
            assert_eq!(parse(text).unwrap_err().kind(), ErrorKind::InvalidMesh, "{text}");
        }
    }

    /// RFC 2397, section 3; RFC 3986, sections 2.1 and 3.1: schemes do not depend on case.
    #[test]
    fn data_uris_are_decoded() {
        for uri in [
            "data:application/octet-stream;base64,Zm9vYg==",
            "data:application/octet-stream;base64,Zm9vYg%3D%3d",
            "data:application/gltf-buffer;charset=utf-8;BASE64,Zm9vYg",
            "DATA:;base64,Zm9vYg==",
            "data:,f%6Fob",
            "data:text/plain;charset=US-ASCII,%66oob",
        ] {
            assert_eq!(Uri::parse(uri).unwrap(), Uri::Data(b"foob".to_vec()), "{uri}");
        }
        for uri in ["data:base64;Zm9v", "data:;base64,Zm9v!", "data:,%6", "data:;base64,Zm 9v"] {
            assert_eq!(Uri::parse(uri).unwrap_err().kind(), ErrorKind::InvalidMesh, "{uri}");
        }
    }

    #[test]
    fn other_schemes_are_refused_by_name() {
        for (uri, scheme) in [
            ("http://example.com/a.bin", "`http:`"),
            ("HTTPS://example.com/a.bin", "`https:`"),
            ("file:///a.bin", "`file:`"),
            ("blob:x", "`blob:`"),
        ] {
            let error = Uri::parse(uri).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::UnsupportedFile);
            assert!(error.message().contains(scheme), "{error}");
        }
        for (uri, name) in [("my%20data.bin", "my data.bin"), ("b%C3%BC.bin", "bü.bin"), ("a/b:c", "a/b:c")]
        {
            assert_eq!(Uri::parse(uri).unwrap(), Uri::File(name.to_string()));
        }
        assert!(Uri::parse("").is_err() && Uri::parse("my%2").is_err());
    }
}
