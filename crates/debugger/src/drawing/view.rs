//! Projects a drawing to a plane, as lines, dots and labels of a picture.

use anyhit_engine::math::array;

use super::{Drawing, Point, PrimitiveFate, Shape, box_lines};

/// Width and height of a picture, in pixels.
pub(super) const EXTENT: [f64; 2] = [960.0, 720.0];
/// What stays free around the drawing.
const MARGIN: f64 = 60.0;
/// What a line of labels takes, in pixels.
const LABEL_HEIGHT: f64 = 16.0;
/// What a letter takes at most.
const LETTER_WIDTH: f64 = 7.0;

/// A point of a picture, from its upper left corner.
pub(super) type PicturePoint = [f64; 2];

/// The role of a line, dot or label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Ray,
    SecondaryRay,
    Box,
    BoxNotEntered,
    Hit,
    Met,
    Missed,
    Text,
}

impl Role {
    /// Red, green and blue.
    pub(super) fn colour(self) -> [u8; 3] {
        match self {
            Self::Ray => [214, 40, 40],
            Self::SecondaryRay => [142, 68, 173],
            Self::Box => [52, 101, 164],
            Self::BoxNotEntered => [176, 190, 206],
            Self::Hit => [22, 128, 60],
            Self::Met => [217, 119, 6],
            Self::Missed => [168, 168, 168],
            Self::Text => [32, 32, 32],
        }
    }

    /// The width of its lines, in pixels.
    pub(super) fn width(self) -> f64 {
        match self {
            Self::Ray | Self::Hit => 2.0,
            _ => 1.0,
        }
    }

    /// Whether its lines have gaps.
    pub(super) fn is_dashed(self) -> bool {
        matches!(self, Self::BoxNotEntered | Self::SecondaryRay)
    }
}

/// A part of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Item {
    Line {
        points: Vec<PicturePoint>,
        role: Role,
    },
    /// A triangle that is filled.
    Fill {
        corners: [PicturePoint; 3],
        role: Role,
    },
    Dot {
        at: PicturePoint,
        role: Role,
    },
    Label {
        at: PicturePoint,
        text: String,
        role: Role,
    },
}

/// A way to look at a drawing: along an axis of the world.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct View {
    /// The axis that points at the eye.
    pub axis: usize,
    /// The least and greatest coordinates that are shown, across and up.
    low: [f64; 2],
    high: [f64; 2],
}

impl View {
    /// Looks along the axis that the ray moves least along, so that it is seen at its longest.
    pub(super) fn of(drawing: &Drawing) -> Self {
        let moves =
            |axis: usize| drawing.rays.first().map_or(0.0, |ray| (ray.to[axis] - ray.from[axis]).abs());
        // Of two that are equal, the view from the front, then from the side, then from above.
        let axis = [2, 0, 1].into_iter().min_by(|&a, &b| moves(a).total_cmp(&moves(b))).unwrap_or(2);
        let mut view = Self { axis, low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };
        let Some(ray) = drawing.rays.first() else { return view };
        view.include(ray.from);
        view.include(ray.to);
        // As much of the primitive that is hit as is no farther from there than the ray came.
        let came = (0..3).map(moves).fold(0.0, f64::max);
        let hit = drawing.primitives.iter().filter(|one| one.fate == PrimitiveFate::Hit);
        for point in hit.flat_map(|one| one.shape.lines().concat()) {
            view.include(array::from_fn(|axis| {
                point[axis].max(ray.to[axis] - came).min(ray.to[axis] + came)
            }));
        }
        view
    }

    fn include(&mut self, point: Point) {
        let flat = self.flat(point);
        for ((value, low), high) in flat.into_iter().zip(&mut self.low).zip(&mut self.high) {
            if value.is_finite() {
                *low = low.min(value);
                *high = high.max(value);
            }
        }
    }

    /// The axes that go to the right and up, each with its sign.
    fn sides(&self) -> [(usize, f64); 2] {
        match self.axis {
            0 => [(2, -1.0), (1, 1.0)],
            1 => [(0, 1.0), (2, -1.0)],
            _ => [(0, 1.0), (1, 1.0)],
        }
    }

    fn flat(&self, point: Point) -> [f64; 2] {
        self.sides().map(|(axis, sign)| sign * point[axis])
    }

    /// Pixels of a unit of the world.
    fn scale(&self) -> f64 {
        let of = |side: usize| (EXTENT[side] - 2.0 * MARGIN) / (self.high[side] - self.low[side]).max(1e-30);
        let scale = of(0).min(of(1));
        if scale.is_finite() { scale } else { 1.0 }
    }

    fn place(&self, point: Point) -> PicturePoint {
        let flat = self.flat(point);
        let scale = self.scale();
        let middle = |side: usize| match (self.low[side] + self.high[side]) / 2.0 {
            middle if middle.is_finite() => middle,
            _ => 0.0,
        };
        [EXTENT[0] / 2.0 + (flat[0] - middle(0)) * scale, EXTENT[1] / 2.0 - (flat[1] - middle(1)) * scale]
    }

    /// The picture of a drawing, from what is farthest behind on.
    pub(super) fn picture(&self, drawing: &Drawing) -> Vec<Item> {
        let mut items = Vec::new();
        let mut labels = Labels::default();
        for drawn in &drawing.boxes {
            let role = if drawn.is_entered { Role::Box } else { Role::BoxNotEntered };
            let lines = box_lines(drawn.corners);
            items.extend(lines.iter().map(|line| self.line(line, role)));
            let corners = drawn.corners.map(|corner| self.place(corner));
            let at = [corners[0][0].min(corners[1][0]), corners[0][1].min(corners[1][1])];
            labels.add(at, drawn.label.clone(), role);
        }
        for drawn in drawing.primitives.iter().rev() {
            let role = match drawn.fate {
                PrimitiveFate::Hit => Role::Hit,
                PrimitiveFate::Met => Role::Met,
                PrimitiveFate::Missed => Role::Missed,
            };
            if let Shape::Triangle(corners) = &drawn.shape {
                items.push(Item::Fill { corners: corners.map(|corner| self.place(corner)), role });
            }
            let lines = drawn.shape.lines();
            items.extend(lines.iter().map(|line| self.line(line, role)));
            if drawn.fate != PrimitiveFate::Missed
                && let Some(&first) = lines.first().and_then(|line| line.first())
            {
                labels.add(self.place(first), drawn.label.clone(), role);
            }
        }
        for (number, ray) in drawing.rays.iter().enumerate().rev() {
            let role = if number == 0 { Role::Ray } else { Role::SecondaryRay };
            let ends = [ray.from, ray.to].map(|end| self.place(end));
            items.push(Item::Line { points: ends.to_vec(), role });
            items.extend(arrow(ends).map(|points| Item::Line { points, role }));
            items.push(Item::Dot { at: ends[0], role });
            if ray.is_hit {
                items.push(Item::Dot { at: ends[1], role });
            }
            let middle = [(ends[0][0] + ends[1][0]) / 2.0, (ends[0][1] + ends[1][1]) / 2.0];
            labels.add(middle, ray.label.clone(), role);
        }
        items.extend(labels.items);
        let [right, up] = self.sides();
        let name = |(axis, sign): (usize, f64)| {
            format!("{}{}", if sign < 0.0 { "-" } else { "+" }, ["x", "y", "z"][axis])
        };
        let text = format!(
            "right is {}, up is {}, {:.4} units wide",
            name(right),
            name(up),
            EXTENT[0] / self.scale()
        );
        items.push(Item::Label { at: [12.0, EXTENT[1] - 12.0], text, role: Role::Text });
        items
    }

    fn line(&self, points: &[Point], role: Role) -> Item {
        Item::Line { points: points.iter().map(|&point| self.place(point)).collect(), role }
    }
}

/// The two lines of an arrow's head at the end of a line.
fn arrow([from, to]: [PicturePoint; 2]) -> Option<Vec<PicturePoint>> {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let length = x.hypot(y);
    (length.is_finite() && length > 12.0).then(|| {
        let (x, y) = (x / length * 10.0, y / length * 10.0);
        vec![[to[0] - x + y / 2.0, to[1] - y - x / 2.0], to, [to[0] - x - y / 2.0, to[1] - y + x / 2.0]]
    })
}

/// Labels that do not lie on each other.
#[derive(Default)]
struct Labels {
    items: Vec<Item>,
    /// Left, right and base line of those that are placed.
    taken: Vec<[f64; 3]>,
}

impl Labels {
    /// Adds a label near a point, inside the picture and below those that are there.
    fn add(&mut self, at: PicturePoint, text: String, role: Role) {
        let width = LETTER_WIDTH * text.chars().count() as f64;
        let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
        let left = finite(at[0] + 4.0).clamp(8.0, (EXTENT[0] - width - 8.0).max(8.0));
        let mut base = finite(at[1] - 4.0).clamp(LABEL_HEIGHT, EXTENT[1] - 2.0 * LABEL_HEIGHT);
        let is_free = |taken: &[[f64; 3]], base: f64| {
            !taken.iter().any(|[from, to, other]| {
                left < *to && *from < left + width && (base - other).abs() < LABEL_HEIGHT
            })
        };
        while !is_free(&self.taken, base) && base < EXTENT[1] - 2.0 * LABEL_HEIGHT {
            base += LABEL_HEIGHT / 2.0;
        }
        // No place is left: the picture is full of labels.
        if is_free(&self.taken, base) {
            self.taken.push([left, left + width, base]);
            self.items.push(Item::Label { at: [left, base], text, role });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::tests::drawing;

    #[test]
    fn a_ray_along_z_is_seen_from_the_side() {
        // It moves along z alone: from the side, along x, z is across.
        let view = View::of(&drawing());
        assert_eq!(view.axis, 0);
        let [start, end] = [[0.0, 0.0, 4.0], [0.0, 0.0, 0.0]].map(|point| view.place(point));
        // -z is to the right, and the whole width is used but for the margins.
        assert_eq!((start[0], end[0]), (60.0, 900.0));
        assert_eq!(start[1], end[1]);
    }

    #[test]
    fn up_is_up() {
        let view = View::of(&drawing());
        assert!(view.place([0.0, 1.0, 0.0])[1] < view.place([0.0, -1.0, 0.0])[1]);
    }

    #[test]
    fn labels_keep_apart() {
        let mut labels = Labels::default();
        labels.add([100.0, 100.0], "one".into(), Role::Text);
        labels.add([100.0, 100.0], "two".into(), Role::Text);
        let at = |item: &Item| match item {
            Item::Label { at, .. } => *at,
            _ => [0.0; 2],
        };
        assert!((at(&labels.items[0])[1] - at(&labels.items[1])[1]).abs() >= LABEL_HEIGHT);
    }
}
