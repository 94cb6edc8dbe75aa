//! Words of command lines that are printed to be typed.

/// A word as a POSIX shell takes it: as it is, in double quotes, or in single quotes where double
/// ones would not keep it.
pub fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./,:=+@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else if !text.contains(['"', '$', '`', '\\', '!', '\n']) {
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
        for text in
            ["", "a b", "it's", "$HOME `x`", "a\"b", "a\\b", "*?[x]", "a;b|c&d", "~", "#1", "!x", "ä", "a\nb"]
        {
            let printed = std::process::Command::new("sh")
                .args(["-c", &format!("printf %s {}", word(text))])
                .output()
                .expect("a shell");
            assert_eq!(String::from_utf8_lossy(&printed.stdout), text);
        }
    }
}
