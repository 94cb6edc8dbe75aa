//! `readMemory`: the bytes of buffers.

use emmy_dap_types::requests::ReadMemoryArguments;
use emmy_dap_types::responses::ReadMemoryResponse;

use super::Adapter;
use super::protocol::{Answer, Refusal, Request, body};

/// The most bytes that are read at a time.
const MOST_BYTES: i64 = 1 << 20;

impl Adapter {
    pub(super) fn read_memory(&mut self, request: &Request) -> Answer {
        let arguments: ReadMemoryArguments = request.arguments()?;
        let launched = self.stopped()?;
        let reference = &arguments.memory_reference;
        let Some((buffer, base)) = launched.stopped.memory(reference) else {
            return Err(Refusal::new(format!("`{reference}` is not a memory reference")));
        };
        let offset = arguments.offset.unwrap_or(0);
        let wanted = arguments.count.clamp(0, MOST_BYTES);
        let first = i64::try_from(*base).unwrap_or(i64::MAX).saturating_add(offset);
        let size = i64::try_from(buffer.size()).unwrap_or(i64::MAX);
        // What lies before the buffer cannot be read, nor what is behind it.
        let count = if (0..size).contains(&first) { wanted.min(size - first) } else { 0 };
        let byte = |at: i64| buffer.load(at as u64, 8).unwrap_or(0) as u8;
        let bytes: Vec<u8> = (first..first + count).map(byte).collect();
        body(ReadMemoryResponse {
            address: format!("{:#x}", first.max(0)),
            unreadable_bytes: Some(wanted - count).filter(|&left| left > 0),
            data: Some(base64(&bytes)).filter(|_| count > 0),
        })
    }
}

/// Bytes as RFC 4648 writes them with 64 characters and padding.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let bits = group.iter().chain(&[0; 2]).take(3).fold(0, |bits, &byte| bits << 8 | u32::from(byte));
        for at in 0..4 {
            let index = bits >> (18 - 6 * at) & 63;
            text.push(if at > group.len() { '=' } else { char::from(ALPHABET[index as usize]) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::base64;

    /// The test vectors of RFC 4648, section 10.
    #[test]
    fn base64_is_that_of_the_rfc() {
        let cases = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, coded) in cases {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }
}
