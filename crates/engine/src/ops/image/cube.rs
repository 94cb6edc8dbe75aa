//! Cube maps: face selection, and texels beyond a face's edge (Vulkan, "Cube Map Face Selection"
//! and "Cube Map Edge Handling").
//!
//! The face is that of the component of largest magnitude; on ties z wins over y and x, y over x. A
//! NaN component is never the largest.

use std::ops::Neg;

use crate::math::array;

/// The face that a direction hits, as the layer within its cube: +x, -x, +y, -y, +z, -z.
pub fn face([x, y, z]: [f32; 3]) -> u32 {
    // A NaN must lose every comparison.
    let size = |component: f32| if component.is_nan() { -1.0 } else { component.abs() };
    let (component, positive) = if size(z) >= size(x) && size(z) >= size(y) {
        (z, 4)
    } else if size(y) >= size(x) {
        (y, 2)
    } else {
        (x, 0)
    };
    positive + u32::from(component.is_sign_negative())
}

/// (s_c, t_c, r_c) of a vector on a face; `r_c` is the component along the face's axis.
pub fn project<T: Copy + Neg<Output = T>>(face: u32, [x, y, z]: [T; 3]) -> [T; 3] {
    match face {
        0 => [-z, -y, x],
        1 => [z, -y, x],
        2 => [x, z, y],
        3 => [x, -z, y],
        4 => [x, -y, z],
        _ => [-x, -y, z],
    }
}

/// The vector whose [`project`]ion this is.
fn unproject(face: u32, [s, t, r]: [i64; 3]) -> [i64; 3] {
    match face {
        0 => [r, -t, -s],
        1 => [r, -t, s],
        2 => [s, r, t],
        3 => [s, r, -t],
        4 => [s, -t, r],
        _ => [-s, -t, r],
    }
}

/// (s_face, t_face) of a direction on its face, in [0, 1].
pub fn coordinates([s, t, r]: [f32; 3]) -> [f32; 2] {
    array::map([s, t], |component| 0.5 * (component / r.abs()) + 0.5)
}

/// The derivatives of (s_face, t_face), given the derivatives `change` of the direction (s_c, t_c,
/// r_c); both on the direction's face ("Cube Map Derivative Transformation").
///
/// `|r_c|` grows with the derivative that the specification's table gives for `r_c`: that of the
/// axis, negated on negative faces.
pub fn derivatives([s, t, r]: [f32; 3], change: [f32; 3]) -> [f32; 2] {
    let growth = if r.is_sign_negative() { -change[2] } else { change[2] };
    let one = |at: f32, change: f32| 0.5 * ((r.abs() * change - at * growth) / (r * r));
    [one(s, change[0]), one(t, change[1])]
}

/// The texel at (i, j) of a face of `size` x `size` texels, and its face, where (i, j) lies one
/// texel beyond an edge; `None` beyond a corner, where there is no texel.
///
/// Texel centres are integer vectors: with the half side `size`, texel i is at `2 i + 1 - size`.
/// Beyond an edge, that is one more than the half side; folded over the edge, the texel lies in the
/// neighbouring face's plane, one step below its border.
pub fn neighbour(face: u32, [i, j]: [i64; 2], size: u32) -> Option<(u32, [i64; 2])> {
    let size = i64::from(size);
    let outside = |at: i64| at < 0 || at >= size;
    if !outside(i) && !outside(j) {
        return Some((face, [i, j]));
    }
    if outside(i) && outside(j) {
        return None;
    }
    let sign = if face.is_multiple_of(2) { 1 } else { -1 };
    let edge = |at: i64| (2 * at + 1 - size).clamp(-size, size);
    let vector = unproject(face, [edge(i), edge(j), sign * (size - 1)]);
    let axis = vector.iter().position(|component| component.abs() == size)?;
    let face = 2 * axis as u32 + u32::from(vector[axis] < 0);
    let [s, t, _] = project(face, vector);
    Some((face, array::map([s, t], |component| (component + size - 1) / 2)))
}

/// The three texels that meet at the corner beyond (i, j): the face's own, then its neighbours'
/// along i and along j.
pub fn corner(face: u32, [i, j]: [i64; 2], size: u32) -> [(u32, [i64; 2]); 3] {
    let inside = |at: i64| at.clamp(0, i64::from(size) - 1);
    let beyond = |at| neighbour(face, at, size).expect("bug in anyhit: there is no texel beyond the edge");
    [(face, [inside(i), inside(j)]), beyond([i, inside(j)]), beyond([inside(i), j])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_major_axis_chooses_and_ties_go_to_z_then_y() {
        let faces = [[2., 1., -1.], [-2., 1., 1.], [1., 2., 1.], [1., -2., 1.], [1., 1., 2.], [1., 1., -2.]];
        assert_eq!(faces.map(face), [0, 1, 2, 3, 4, 5]);
        assert_eq!(face([1.0, 1.0, 1.0]), 4);
        assert_eq!(face([-1.0, -1.0, -1.0]), 5);
        assert_eq!(face([1.0, -1.0, 0.5]), 3);
        assert_eq!(face([1.0, f32::NAN, 0.5]), 0);
        // On a tie of all components, z wins.
        assert_eq!(face([0.0; 3]), 4);
    }

    #[test]
    fn the_table_of_coordinates() {
        // The rows of "Cube map face and coordinate selection" for (rx, ry, rz) = (1, 2, 3).
        let table = [[-3, -2, 1], [3, -2, 1], [1, 3, 2], [1, -3, 2], [1, -2, 3], [-1, -2, 3]];
        for (face, row) in (0..).zip(table) {
            assert_eq!(project(face, [1, 2, 3]), row);
            assert_eq!(unproject(face, row), [1, 2, 3]);
        }
        // (4, 1, -2): +x, s = 2 / 4 / 2 + 1/2, t = -1 / 4 / 2 + 1/2.
        assert_eq!(coordinates(project(0, [4.0, 1.0, -2.0])), [0.75, 0.375]);
        // (2, -1, -4): -z, s = -2 / 4 / 2 + 1/2, t = 1 / 4 / 2 + 1/2.
        assert_eq!(coordinates(project(5, [2.0, -1.0, -4.0])), [0.25, 0.625]);
    }

    #[test]
    fn derivatives_follow_the_quotient_rule() {
        // s_face = s / (2 |r|) + 1/2 at s = 1, |r| = 2: by s 1/4, by |r| -1/8.
        assert_eq!(derivatives([1.0, 0.0, 2.0], [1.0, 0.0, 0.0]), [0.25, 0.0]);
        assert_eq!(derivatives([1.0, 0.0, 2.0], [0.0, 0.0, 1.0]), [-0.125, 0.0]);
        // r = -2, moving towards -3: |r| grows.
        assert_eq!(derivatives([1.0, 1.0, -2.0], [0.0, 0.0, -1.0]), [-0.125, -0.125]);
    }

    #[test]
    fn neighbours_share_the_edge() {
        // Every texel beyond an edge must touch the texel that it is reached from: for their
        // centres in space, (4 times) the distance is that of two cells folded over the cube's
        // edge.
        let size = 4;
        let centre = |face: u32, [i, j]: [i64; 2]| {
            let sign = if face.is_multiple_of(2) { 1 } else { -1 };
            unproject(face, [2 * i + 1 - size, 2 * j + 1 - size, sign * size])
        };
        for face in 0..6 {
            for along in 0..size {
                for (inside, outside) in [
                    ([0, along], [-1, along]),
                    ([size - 1, along], [size, along]),
                    ([along, 0], [along, -1]),
                    ([along, size - 1], [along, size]),
                ] {
                    let (other, at) = neighbour(face, outside, size as u32).unwrap();
                    assert_ne!(other / 2, face / 2);
                    let (a, b) = (centre(face, inside), centre(other, at));
                    let squares: i64 = (0..3).map(|axis| (a[axis] - b[axis]).pow(2)).sum();
                    assert_eq!(squares, 2, "face {face} {outside:?} -> {other} {at:?}");
                }
            }
        }
    }

    #[test]
    fn a_known_edge() {
        // Right of +z lies +x, upright: its column 0. Above +z lies +y, upright: its lowest row.
        assert_eq!(neighbour(4, [4, 1], 4), Some((0, [0, 1])));
        assert_eq!(neighbour(4, [2, -1], 4), Some((2, [2, 3])));
        assert_eq!(neighbour(4, [2, 3], 4), Some((4, [2, 3])));
        assert_eq!(neighbour(4, [4, -1], 4), None);
        assert_eq!(corner(4, [4, -1], 4), [(4, [3, 0]), (0, [0, 0]), (2, [3, 3])]);
        assert_eq!(neighbour(4, [1, 0], 1), Some((0, [0, 0])));
    }
}
