//! Writes a drawing as Wavefront OBJ.

use std::fmt::Write as _;

use anyhit_base::escape;

use super::{Drawing, Point, PrimitiveFate, Shape, box_lines};

/// The text of an OBJ file.
pub(super) fn write(drawing: &Drawing) -> String {
    let mut file =
        ObjFile { text: "# A ray, the boxes of instances and the primitives tested\n".into(), count: 0 };
    for (number, ray) in drawing.rays.iter().enumerate() {
        let hit = if ray.is_hit { "hit" } else { "miss" };
        file.group(&format!("ray_{number}_{hit}"), &ray.label);
        file.line(&[ray.from, ray.to]);
    }
    for drawn in &drawing.boxes {
        let entered = if drawn.is_entered { "entered" } else { "not_entered" };
        file.group(&format!("box_{entered}_{}", word(&drawn.label)), &drawn.label);
        box_lines(drawn.corners).iter().for_each(|line| file.line(line));
    }
    for drawn in &drawing.primitives {
        let fate = match drawn.fate {
            PrimitiveFate::Hit => "hit",
            PrimitiveFate::Met => "met",
            PrimitiveFate::Missed => "missed",
        };
        file.group(&format!("{fate}_{}", word(&drawn.label)), &drawn.label);
        match &drawn.shape {
            Shape::Triangle(corners) => file.face(corners),
            Shape::Lines(lines) => lines.iter().for_each(|line| file.line(line)),
        }
    }
    file.text
}

struct ObjFile {
    text: String,
    /// How many vertices were written.
    count: usize,
}

impl ObjFile {
    fn group(&mut self, name: &str, comment: &str) {
        let comment = escape::line(comment);
        let _ = writeln!(self.text, "# {comment}\ng {name}");
    }

    fn line(&mut self, points: &[Point]) {
        self.element('l', points);
    }

    fn face(&mut self, points: &[Point]) {
        self.element('f', points);
    }

    /// The vertices of an element, and it.
    fn element(&mut self, kind: char, points: &[Point]) {
        for [x, y, z] in points {
            let _ = writeln!(self.text, "v {} {} {}", *x as f32, *y as f32, *z as f32);
        }
        let numbers: Vec<String> = (1..=points.len()).map(|at| (self.count + at).to_string()).collect();
        let _ = writeln!(self.text, "{kind} {}", numbers.join(" "));
        self.count += points.len();
    }
}

/// A label as one word, as the name of a group ends at a blank; without what is behind a comma.
fn word(label: &str) -> String {
    let label = label.split(',').next().unwrap_or_default();
    let letter = |letter: char| if letter.is_alphanumeric() { letter } else { '_' };
    let word: String = label.chars().map(letter).collect();
    word.trim_matches('_').replace("__", "_")
}

#[cfg(test)]
mod tests {
    use crate::drawing::tests::drawing;

    #[test]
    fn each_part_is_a_group_and_vertices_are_counted_on() {
        let obj = drawing().obj();
        let groups: Vec<&str> = obj.lines().filter_map(|line| line.strip_prefix("g ")).collect();
        assert_eq!(
            groups,
            ["ray_0_hit", "box_entered_instance_0_wall", "hit_instance_0_geometry_0_primitive_0"]
        );
        // 2 of the ray, 2 x 5 + 4 x 2 of the box, 3 of the triangle.
        assert_eq!(obj.lines().filter(|line| line.starts_with("v ")).count(), 23);
        assert!(obj.ends_with("f 21 22 23\n"), "{obj}");
        assert!(obj.contains("v 0 0 4\nv 0 0 0\nl 1 2\n"), "{obj}");
    }
}
