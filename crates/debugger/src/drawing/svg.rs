//! Writes a picture as SVG.

use std::fmt::Write as _;

use anyhit_base::escape;

use super::view::{EXTENT, Item, PicturePoint, Role};

/// The text of an SVG file.
pub(super) fn write(items: &[Item]) -> String {
    let [width, height] = EXTENT;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for item in items {
        let _ = match item {
            Item::Line { points, role } => writeln!(
                text,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{}/>",
                list(points),
                colour(*role),
                role.width(),
                if role.is_dashed() { " stroke-dasharray=\"6 4\"" } else { "" }
            ),
            Item::Fill { corners, role } => writeln!(
                text,
                "<polygon points=\"{}\" fill=\"{}\" fill-opacity=\"0.25\"/>",
                list(corners),
                colour(*role)
            ),
            Item::Dot { at: [x, y], role } => {
                writeln!(text, "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"4\" fill=\"{}\"/>", colour(*role))
            }
            Item::Label { at: [x, y], text: label, role } => writeln!(
                text,
                "<text x=\"{x:.2}\" y=\"{y:.2}\" fill=\"{}\">{}</text>",
                colour(*role),
                escape::markup(&escape::line(label))
            ),
        };
    }
    text.push_str("</svg>\n");
    text
}

fn list(points: &[PicturePoint]) -> String {
    let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
    points.join(" ")
}

fn colour(role: Role) -> String {
    let [red, green, blue] = role.colour();
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[cfg(test)]
mod tests {
    use crate::drawing::tests::drawing;

    #[test]
    fn names_of_scenes_are_escaped() {
        let svg = drawing().svg();
        assert!(svg.contains(">depth 1: hit &lt;a&gt; &amp; b</text>"), "{svg}");
        assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("<polygon").count(), 1);
    }
}
