//! Draws a picture into pixels.

use anyhit_scene::image::Rgba8;

use super::view::{EXTENT, Item, PicturePoint, Role};

/// How many pixels a dot of a letter takes.
const LETTER_DOT: usize = 2;

/// The letters in 5 rows of 3 dots: an octal digit is a row, its highest bit the dot on the left.
const LETTERS: &[(char, u16)] = &[
    ('0', 0o75557),
    ('1', 0o26227),
    ('2', 0o71747),
    ('3', 0o71717),
    ('4', 0o55711),
    ('5', 0o74717),
    ('6', 0o74757),
    ('7', 0o71122),
    ('8', 0o75757),
    ('9', 0o75717),
    ('a', 0o25755),
    ('b', 0o65656),
    ('c', 0o34443),
    ('d', 0o65556),
    ('e', 0o74647),
    ('f', 0o74644),
    ('g', 0o34553),
    ('h', 0o55755),
    ('i', 0o72227),
    ('j', 0o11152),
    ('k', 0o55655),
    ('l', 0o44447),
    ('m', 0o57755),
    ('n', 0o65555),
    ('o', 0o25552),
    ('p', 0o65644),
    ('q', 0o25563),
    ('r', 0o65655),
    ('s', 0o34216),
    ('t', 0o72222),
    ('u', 0o55557),
    ('v', 0o55552),
    ('w', 0o55775),
    ('x', 0o55255),
    ('y', 0o55222),
    ('z', 0o71247),
    ('.', 0o00002),
    (',', 0o00024),
    ('-', 0o00700),
    ('+', 0o02720),
    ('(', 0o12221),
    (')', 0o42224),
    (':', 0o02020),
    ('=', 0o07070),
    ('/', 0o11244),
    ('_', 0o00007),
    ('`', 0o42000),
    (' ', 0),
];
/// What stands for letters that there are none of.
const UNKNOWN: u16 = 0o77777;

/// The pixels of a picture.
pub(super) fn image(items: &[Item]) -> Rgba8 {
    let [width, height] = EXTENT.map(|side| side as usize);
    let mut canvas = Canvas { width, height, pixels: vec![255; 4 * width * height] };
    for item in items {
        match item {
            Item::Line { points, role } => {
                for pair in points.windows(2) {
                    canvas.line(pair[0], pair[1], *role);
                }
            }
            Item::Fill { corners, role } => canvas.fill(corners, *role),
            Item::Dot { at, role } => canvas.dot(*at, *role),
            Item::Label { at, text, role } => canvas.label(*at, text, *role),
        }
    }
    Rgba8 { extent: [width as u32, height as u32], pixels: canvas.pixels }
}

struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    /// Mixes a colour into a pixel.
    fn put(&mut self, x: f64, y: f64, role: Role, share: f64) {
        let is_inside = (0.0..self.width as f64).contains(&x) && (0.0..self.height as f64).contains(&y);
        if !is_inside {
            return;
        }
        let at = 4 * (y as usize * self.width + x as usize);
        for (channel, value) in self.pixels[at..at + 3].iter_mut().zip(role.colour()) {
            *channel = (f64::from(*channel) * (1.0 - share) + f64::from(value) * share).round() as u8;
        }
    }

    fn line(&mut self, from: PicturePoint, to: PicturePoint, role: Role) {
        let extent = [self.width as f64, self.height as f64];
        let Some([from, to]) = clipped(from, to, extent) else { return };
        let (x, y) = (to[0] - from[0], to[1] - from[1]);
        let steps = x.abs().max(y.abs()).ceil().max(1.0);
        for step in 0..=steps as usize {
            if role.is_dashed() && step % 10 >= 6 {
                continue;
            }
            let share = step as f64 / steps;
            let (x, y) = (from[0] + x * share, from[1] + y * share);
            self.put(x, y, role, 1.0);
            if role.width() > 1.0 {
                self.put(x + 1.0, y, role, 1.0);
                self.put(x, y + 1.0, role, 1.0);
            }
        }
    }

    fn dot(&mut self, [x, y]: PicturePoint, role: Role) {
        for row in -4..=4i32 {
            for column in -4..=4i32 {
                if row * row + column * column <= 16 {
                    self.put(x + f64::from(column), y + f64::from(row), role, 1.0);
                }
            }
        }
    }

    /// Fills a triangle: the pixels whose middles are on one side of all edges.
    fn fill(&mut self, corners: &[PicturePoint; 3], role: Role) {
        let range = |side: usize, limit: usize| {
            let values = corners.map(|corner| corner[side]);
            let low = values.into_iter().fold(f64::INFINITY, f64::min).max(0.0);
            let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max).min(limit as f64);
            low as usize..high.max(0.0).ceil() as usize
        };
        let (columns, rows) = (range(0, self.width), range(1, self.height));
        for y in rows {
            for x in columns.clone() {
                let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
                let side = |a: PicturePoint, b: PicturePoint| {
                    (b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])
                };
                let [a, b, c] = *corners;
                let sides = [side(a, b), side(b, c), side(c, a)];
                if sides.iter().all(|one| *one > 0.0) || sides.iter().all(|one| *one < 0.0) {
                    self.put(px, py, role, 0.25);
                }
            }
        }
    }

    /// Writes a label; its point is the left end of the base line.
    fn label(&mut self, [x, y]: PicturePoint, text: &str, role: Role) {
        for (number, letter) in text.to_lowercase().chars().enumerate() {
            let known = LETTERS.iter().find(|(known, _)| *known == letter);
            let rows = known.map_or(UNKNOWN, |(_, rows)| *rows);
            for dot in 0..15 {
                if rows >> (14 - dot) & 1 == 0 {
                    continue;
                }
                let (row, column) = (dot / 3, dot % 3);
                let left = x + ((number * 4 + column) * LETTER_DOT) as f64 * 0.85;
                let top = y - ((5 - row) * LETTER_DOT) as f64;
                for part in 0..LETTER_DOT * LETTER_DOT {
                    let (right, down) = (part % LETTER_DOT, part / LETTER_DOT);
                    self.put(left + right as f64, top + down as f64, role, 1.0);
                }
            }
        }
    }
}

/// The part of a line inside a rectangle from 0 on; `None` where there is none.
fn clipped(from: PicturePoint, to: PicturePoint, extent: [f64; 2]) -> Option<[PicturePoint; 2]> {
    let (mut begin, mut end) = (0.0f64, 1.0f64);
    for side in 0..2 {
        let step = to[side] - from[side];
        if !step.is_finite() {
            return None;
        }
        if step == 0.0 {
            if !(0.0..=extent[side]).contains(&from[side]) {
                return None;
            }
            continue;
        }
        let (a, b) = (-from[side] / step, (extent[side] - from[side]) / step);
        begin = begin.max(a.min(b));
        end = end.min(a.max(b));
    }
    let at = |share: f64| [0, 1].map(|side| from[side] + share * (to[side] - from[side]));
    (begin <= end).then(|| [at(begin), at(end)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_clipped_at_the_border() {
        let extent = [10.0, 10.0];
        assert_eq!(clipped([-10.0, 5.0], [30.0, 5.0], extent), Some([[0.0, 5.0], [10.0, 5.0]]));
        assert_eq!(clipped([-10.0, -5.0], [30.0, -5.0], extent), None);
        assert_eq!(clipped([2.0, 2.0], [3.0, 3.0], extent), Some([[2.0, 2.0], [3.0, 3.0]]));
        assert_eq!(clipped([f64::NAN, 2.0], [3.0, 3.0], extent), None);
    }

    #[test]
    fn a_line_colours_its_pixels_alone() {
        let line = Item::Line { points: vec![[10.0, 20.0], [30.0, 20.0]], role: Role::Box };
        let image = image(&[line]);
        let pixel = |x: usize, y: usize| &image.pixels[4 * (y * 960 + x)..][..3];
        assert_eq!(pixel(20, 20), Role::Box.colour());
        assert_eq!(pixel(20, 22), [255, 255, 255]);
        assert_eq!(pixel(40, 20), [255, 255, 255]);
    }
}
