//! Styles of text on terminals.

/// A role of a piece of text.
///
/// The colours have a contrast of at least 4.5 on white and on black (WCAG 2.2, 1.4.3), so that
/// they are legible on light and on dark terminals. They are entries of the 256-colour palette,
/// whose values terminals do not vary, unlike those of the first 16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// A heading.
    Heading,
    /// Bold text.
    Strong,
    /// A name or a line number.
    Name,
    /// An accepted hit or a passed test.
    Good,
    /// Rejected, or of less interest.
    Faint,
    /// An error, a trap or a failed test.
    Bad,
    /// A warning or a known failure.
    Warning,
}

impl Style {
    /// Every style.
    pub const ALL: [Self; 7] =
        [Self::Heading, Self::Strong, Self::Name, Self::Good, Self::Faint, Self::Bad, Self::Warning];

    /// Its entry of the 256-colour palette; `None` for the colour of all text.
    #[must_use]
    pub const fn colour(self) -> Option<u8> {
        match self {
            Self::Strong => None,
            Self::Heading | Self::Name => Some(63),
            Self::Good => Some(29),
            Self::Faint => Some(243),
            Self::Bad => Some(131),
            Self::Warning => Some(163),
        }
    }

    /// Returns true for bold text.
    const fn is_bold(self) -> bool {
        matches!(self, Self::Heading | Self::Strong | Self::Bad)
    }

    /// The text in this style, if it is shown with colours.
    #[must_use]
    pub fn paint(self, text: &str, coloured: bool) -> String {
        let bold = if self.is_bold() { "1" } else { "" };
        match self.colour() {
            _ if !coloured => text.to_owned(),
            None => format!("\u{1b}[{bold}m{text}\u{1b}[0m"),
            Some(colour) => {
                let separator = if bold.is_empty() { "" } else { ";" };
                format!("\u{1b}[{bold}{separator}38;5;{colour}m{text}\u{1b}[0m")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Red, green and blue of an entry of xterm's palette from 16 on: a cube of six levels, then
    /// greys.
    fn rgb(entry: u8) -> [u8; 3] {
        const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];
        match entry {
            ..16 => panic!("terminals vary the first 16 entries"),
            16..232 => [36, 6, 1].map(|step| LEVELS[usize::from((entry - 16) / step % 6)]),
            232.. => [8 + 10 * (entry - 232); 3],
        }
    }

    /// The relative luminance that WCAG 2.2 defines.
    fn luminance(rgb: [u8; 3]) -> f64 {
        let linear = rgb.map(|channel| {
            let channel = f64::from(channel) / 255.0;
            if channel <= 0.04045 { channel / 12.92 } else { ((channel + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    #[test]
    fn colours_are_legible_on_light_and_dark_terminals() {
        for entry in Style::ALL.into_iter().filter_map(Style::colour) {
            let luminance = luminance(rgb(entry));
            let (on_white, on_black) = (1.05 / (luminance + 0.05), (luminance + 0.05) / 0.05);
            assert!(on_white >= 4.5 && on_black >= 4.5, "{entry}: {on_white:.2} and {on_black:.2}");
        }
    }

    #[test]
    fn text_is_painted_where_colours_are_shown() {
        assert_eq!(Style::Bad.paint("a", true), "\u{1b}[1;38;5;131ma\u{1b}[0m");
        assert_eq!(Style::Good.paint("a", true), "\u{1b}[38;5;29ma\u{1b}[0m");
        assert_eq!(Style::Strong.paint("a", true), "\u{1b}[1ma\u{1b}[0m");
        assert!(Style::ALL.iter().all(|style| style.paint("a", false) == "a"));
    }
}
