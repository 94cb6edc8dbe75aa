//! A shader's normal, compared with the exact one of the surface that was hit.

use crate::value::Value;

/// The angle between two vectors, in degrees; `None` where one has no direction.
pub fn angle_in_degrees(a: [f64; 3], b: [f64; 3]) -> Option<f64> {
    // Scaled first, so that no square leaves the range.
    let [a, b] = [scaled(a)?, scaled(b)?];
    let cross = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i]);
    Some(length(cross).atan2(dot(a, b)).to_degrees())
}

/// A vector whose greatest component is 1 or -1; `None` for one that is zero or not finite.
fn scaled(vector: [f64; 3]) -> Option<[f64; 3]> {
    let greatest = vector.iter().fold(0.0f64, |greatest, component| greatest.max(component.abs()));
    let is_vector = vector.iter().all(|component| component.is_finite()) && greatest > 0.0;
    is_vector.then(|| vector.map(|component| component / greatest))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(vector: [f64; 3]) -> f64 {
    dot(vector, vector).sqrt()
}

/// What is wrong with a shader's normal, where it has to be within so many degrees of the exact
/// one; `None` if nothing is.
pub fn difference(found: [f64; 3], exact: [f32; 3], degrees: f64) -> Option<String> {
    let [x, y, z] = exact;
    let [fx, fy, fz] = found.map(|component| component as f32);
    let exact_words =
        format!("expected the exact normal ({x:?}, {y:?}, {z:?}), found ({fx:?}, {fy:?}, {fz:?})");
    match angle_in_degrees(found, exact.map(f64::from)) {
        Some(angle) if angle <= degrees => None,
        Some(angle) if 180.0 - angle <= degrees.min(90.0) => {
            Some(format!("{exact_words}: it points away from the ray, to the other side of the surface"))
        }
        Some(angle) => Some(format!("{exact_words}, {angle:.3} degrees away (allowed: {degrees})")),
        None => Some(format!("{exact_words}, which has no direction")),
    }
}

/// The three numbers at a path of members, `surface.normal` or `path[1].normal`, and the word at
/// which they begin. Without a path: the member `normal`, else the value itself.
///
/// # Errors
/// What is wrong with the path, in words.
pub fn vector_at(value: &Value, path: Option<&str>) -> Result<([f64; 3], usize), String> {
    let path = path.unwrap_or(if value.field("normal").is_some() { "normal" } else { "" });
    let (mut part, mut word) = (value, 0);
    for step in path.split(['.', '[']).filter(|step| !step.is_empty()) {
        let index = step.strip_suffix(']').map(str::parse::<usize>);
        let next = match index {
            Some(Ok(index)) => {
                word += part.elements().iter().take(index).map(words).sum::<usize>();
                part.elements().get(index)
            }
            Some(Err(_)) => None,
            None => {
                word += part
                    .fields()
                    .take_while(|(name, _)| *name != step)
                    .map(|(_, one)| words(one))
                    .sum::<usize>();
                part.field(step)
            }
        };
        part = next.ok_or_else(|| {
            let members: Vec<&str> = part.fields().map(|(name, _)| name).collect();
            let known = if members.is_empty() {
                String::new()
            } else {
                format!(": its members are {}", members.join(", "))
            };
            format!("{} has no `{step}`{known}", part.ty())
        })?;
    }
    let numbers: Vec<f64> = part.numbers().iter().map(|(scalar, bits)| scalar.value(*bits)).collect();
    let vector = <[f64; 3]>::try_from(numbers);
    vector.map(|vector| (vector, word)).map_err(|_| {
        let what = if path.is_empty() { "the payload".to_owned() } else { format!("`{path}`") };
        format!(
            "{what} is {}, not a vector of three numbers: name the member that holds the normal",
            part.ty()
        )
    })
}

/// How many words a part of a payload takes.
fn words(value: &Value) -> usize {
    value.bytes().len() / 4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_hold_for_vectors_of_any_length() {
        assert_eq!(angle_in_degrees([0.0, 0.0, 2.0], [0.0, 0.0, 1.0]), Some(0.0));
        assert_eq!(angle_in_degrees([1e-300, 0.0, 0.0], [0.0, 1e300, 0.0]), Some(90.0));
        assert_eq!(angle_in_degrees([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]), Some(180.0));
        assert_eq!(angle_in_degrees([0.0; 3], [1.0, 0.0, 0.0]), None);
        assert_eq!(angle_in_degrees([f64::NAN, 0.0, 0.0], [1.0, 0.0, 0.0]), None);
        // atan2 holds small angles: 1e-6 to the side.
        let small = angle_in_degrees([1e-6, 0.0, 1.0], [0.0, 0.0, 1.0]).expect("an angle");
        assert!((small - 1e-6f64.atan().to_degrees()).abs() < 1e-18);
    }

    #[test]
    fn a_normal_to_the_other_side_is_told_apart() {
        let up = [0.0, 0.0, 1.0f32];
        assert_eq!(difference([0.0, 0.0, 1.0], up, 0.0), None);
        assert!(difference([0.0, 0.0, -1.0], up, 0.01).is_some_and(|words| words.contains("other side")));
        let leaning = difference([0.1, 0.0, 1.0], up, 1.0).expect("a difference");
        assert!(leaning.contains("5.711 degrees away (allowed: 1)"), "{leaning}");
        assert_eq!(difference([0.1, 0.0, 1.0], up, 6.0), None);
    }
}
