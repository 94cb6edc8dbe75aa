//! Changes to bytes, and to the containers that they stand in: chunks of PNG with their checksums,
//! those of GLB with their lengths, the header of safetensors.

use super::text;
use crate::support::mutate::Random;

/// Changes bytes in place: bits, words of some widths, runs that are dropped, doubled or taken from
/// another file.
pub fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    if bytes.is_empty() {
        bytes.extend((0..random.below(64)).map(|_| random.next() as u8));
        return;
    }
    let at = random.below(bytes.len());
    match random.below(8) {
        0 | 1 => bytes[at] ^= 1 << random.below(8),
        2 | 3 => {
            let width = [1, 2, 4, 8][random.below(4)];
            let value = match random.below(4) {
                0 => random.below(300) as u64,
                1 => (1_u64 << random.below(64)).wrapping_sub(random.below(2) as u64),
                2 => u64::MAX - random.below(3) as u64,
                _ => random.next(),
            };
            let [little, big] = [value.to_le_bytes(), value.swap_bytes().to_le_bytes()];
            let word = if random.below(2) == 0 { &little[..width] } else { &big[8 - width..] };
            for (byte, &new) in bytes[at..].iter_mut().zip(word) {
                *byte = new;
            }
        }
        4 => {
            let end = bytes.len().min(at + 1 + random.below(64));
            bytes.drain(at..end);
        }
        5 => {
            let end = bytes.len().min(at + 1 + random.below(64));
            let run = bytes[at..end].to_vec();
            bytes.splice(at..at, run);
        }
        6 if !other.is_empty() => {
            let from = random.below(other.len());
            let run = &other[from..other.len().min(from + 1 + random.below(256))];
            let end = bytes.len().min(at + run.len());
            bytes.splice(at..end, run.iter().copied());
        }
        _ => bytes.truncate(at),
    }
}

/// One to four changes of the bytes, inside the container that they are, which stays whole in most
/// mutants.
pub fn mutant(bytes: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    if random.below(4) > 0 {
        let inside = match bytes {
            [0x89, b'P', b'N', b'G', ..] => png(bytes, other, random),
            [b'g', b'l', b'T', b'F', ..] => glb(bytes, other, random),
            _ => safetensors(bytes, other, random),
        };
        if let Some(inside) = inside {
            return inside;
        }
    }
    let mut bytes = bytes.to_vec();
    for _ in 0..1 + random.below(4) {
        change(&mut bytes, other, random);
    }
    bytes
}

/// Changes the data of a chunk, doubles or drops one, or adds one that readers decompress, and
/// mends lengths and checksums.
fn png(bytes: &[u8], other: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let mut chunks: Vec<([u8; 4], Vec<u8>)> = Vec::new();
    let mut rest = bytes.get(8..)?;
    while let Some((length, behind)) = rest.split_first_chunk::<4>() {
        let length = u32::from_be_bytes(*length) as usize;
        let (name, behind) = behind.split_first_chunk::<4>()?;
        chunks.push((*name, behind.get(..length)?.to_vec()));
        rest = behind.get(length + 4..)?;
    }
    let at = random.below(chunks.len());
    match random.below(8) {
        0 => {
            chunks.remove(at);
        }
        1 => {
            let twice = chunks[at].clone();
            chunks.insert(random.below(chunks.len()), twice);
        }
        2 => {
            const NAMES: [&[u8; 4]; 8] =
                [b"iCCP", b"zTXt", b"iTXt", b"tRNS", b"PLTE", b"acTL", b"sBIT", b"eXIf"];
            let mut data = chunks[random.below(chunks.len())].1.clone();
            if random.below(2) == 0 {
                data.splice(0..0, b"name\0\0".iter().copied());
            }
            chunks.insert(1.min(chunks.len()), (*NAMES[random.below(8)], data));
        }
        _ => change(&mut chunks[at].1, other, random),
    }
    let mut changed = bytes[..8].to_vec();
    for (name, data) in chunks {
        changed.extend((data.len() as u32).to_be_bytes());
        let start = changed.len();
        changed.extend(name);
        changed.extend(data);
        let checksum = crc32(&changed[start..]);
        changed.extend(checksum.to_be_bytes());
    }
    Some(changed)
}

/// The checksum of PNG (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| (crc >> 1) ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 };
    !bytes.iter().fold(!0, |crc: u32, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}

/// Changes the JSON or the bytes of a GLB file, and mends its lengths.
fn glb(bytes: &[u8], other: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let length = word(12)? as usize;
    let json = String::from_utf8_lossy(bytes.get(20..20 + length)?);
    let mut rest = bytes.get(20 + length..)?.to_vec();
    let mut json = match random.below(4) {
        0 => {
            change(&mut rest, other, random);
            json.into_owned()
        }
        _ => text::mutant(&json, &json, random),
    };
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let mut changed = bytes[..8].to_vec();
    changed.extend(((20 + json.len() + rest.len()) as u32).to_le_bytes());
    changed.extend((json.len() as u32).to_le_bytes());
    changed.extend(b"JSON");
    changed.extend(json.bytes());
    changed.extend(rest);
    Some(changed)
}

/// Changes the JSON header or the numbers of a safetensors file, and mends the header's length.
fn safetensors(bytes: &[u8], other: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let length = u64::from_le_bytes(bytes.get(..8)?.try_into().ok()?);
    let length = usize::try_from(length).ok().filter(|&length| length < bytes.len())?;
    let header = std::str::from_utf8(bytes.get(8..8 + length)?).ok().filter(|text| text.starts_with('{'))?;
    let mut data = bytes[8 + length..].to_vec();
    let header = match random.below(2) {
        0 => {
            // Numbers change and their count does not.
            let whole = data.len();
            change(&mut data, other, random);
            data.resize(whole, 0);
            header.to_owned()
        }
        _ => text::mutant(header, header, random),
    };
    let mut changed = (header.len() as u64).to_le_bytes().to_vec();
    changed.extend(header.bytes());
    changed.extend(data);
    Some(changed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_png() {
        // The check value of CRC-32/ISO-HDLC.
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }
}
