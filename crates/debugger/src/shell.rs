//! Words of command lines that are printed to be typed.

use anyhit_base::escape;

/// A word as a POSIX shell takes it: as it is, in double quotes, or in single quotes where double
/// ones would not keep it. Where characters of it would be hidden, `printf` makes it of their
/// bytes.
pub fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./,:=+@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else if text.contains(escape::is_hidden) {
        let mut octal = String::new();
        for c in text.chars() {
            match c {
                '\\' => octal.push_str("\\\\"),
                '\'' => octal.push_str("'\\''"),
                c if escape::is_hidden(c) => {
                    for byte in c.encode_utf8(&mut [0; 4]).bytes() {
                        octal.push_str(&format!("\\0{byte:03o}"));
                    }
                }
                c => octal.push(c),
            }
        }
        format!("\"$(printf %b '{octal}')\"")
    } else if !text.contains(['"', '$', '`', '\\', '!']) {
        format!("\"{text}\"")
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_reads_back_every_word() {
        assert_eq!(word("scenes/a.toml"), "scenes/a.toml");
        assert_eq!(word("name, with comma"), "\"name, with comma\"");
        assert_eq!(word("$5 'a'"), "'$5 '\\''a'\\'''");
        #[cfg(unix)]
        for text in [
            "",
            "a b",
            "it's",
            "$HOME `x`",
            "a\"b",
            "a\\b",
            "*?[x]",
            "a;b|c&d",
            "~",
            "#1",
            "!x",
            "ä",
            "a\nb",
            "\u{1b}[1m $x `y` 'z' \\0101 %s \u{202e}.",
        ] {
            assert!(!word(text).contains(escape::is_hidden), "{text:?}");
            let printed = std::process::Command::new("sh")
                .args(["-c", &format!("printf %s {}", word(text))])
                .output()
                .expect("a shell");
            assert_eq!(String::from_utf8_lossy(&printed.stdout), text);
        }
    }
}
