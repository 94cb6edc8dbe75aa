//! The plane on which invocations are shown, a pixel each.

use std::cmp::Ordering;

use anyhit_engine::math::array;

/// Kind of the invocations of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaneKind {
    /// A launch, whose invocations are called pixels.
    Launch,
    /// A dispatch of workgroups with so many invocations along x and y.
    Dispatch([u32; 2]),
}

impl PlaneKind {
    /// Name of an invocation: `pixel` or `invocation`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Launch => "pixel",
            Self::Dispatch(_) => "invocation",
        }
    }
}

/// Mapping from the invocations of a launch or dispatch to pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InvocationPlane {
    /// Kind of the invocations.
    pub kind: PlaneKind,
    /// Invocations along x, y and z.
    pub size: [u32; 3],
    /// Width and height in pixels.
    pub extent: [u32; 2],
    /// Number of invocations, in launch order, from a pixel to the one below it.
    pub stride: u32,
}

impl InvocationPlane {
    /// The plane of a dispatch of workgroups of a size, or of a launch.
    pub fn of(size: [u32; 3], workgroup_size: Option<[u32; 3]>) -> Self {
        match workgroup_size {
            Some(workgroup_size) => Self::of_dispatch(size, workgroup_size),
            None => Self::of_launch(size),
        }
    }

    /// The plane of a launch: launch indices are pixels, and slices of a depth are below each
    /// other.
    pub fn of_launch(size: [u32; 3]) -> Self {
        let [width, height, depth] = size;
        let extent = [width, height.saturating_mul(depth)];
        Self { kind: PlaneKind::Launch, size, extent, stride: width }
    }

    /// The plane of a dispatch of workgroups: as that of a launch, but one row of invocations is
    /// folded into rows of whole workgroups, or of equal parts of one, so that the plane is most
    /// like a square.
    pub fn of_dispatch(size: [u32; 3], [group_width, group_height, _]: [u32; 3]) -> Self {
        let kind = PlaneKind::Dispatch([group_width, group_height]);
        let plane = Self { kind, ..Self::of_launch(size) };
        let [width, height, depth] = size;
        if height != 1 || depth != 1 {
            return plane;
        }
        let groups = width / group_width.max(1);
        let divisors = |number: u32| (1..=number).filter(move |part| number.is_multiple_of(*part));
        let strides = divisors(groups).map(|count| count * group_width).chain(divisors(group_width));
        // Ties prefer the wider plane.
        let elongation = |stride: u32| {
            let (width, height) = (f64::from(stride), f64::from(width / stride));
            ((width / height).max(height / width), height)
        };
        let best = strides.min_by(|one, other| {
            elongation(*one).partial_cmp(&elongation(*other)).unwrap_or(Ordering::Equal)
        });
        match best.filter(|_| width > 0) {
            Some(stride) => Self { extent: [stride, width / stride], stride, ..plane },
            None => plane,
        }
    }

    /// The part of the plane that is a picture of this extent, if the picture has a pixel for each
    /// invocation but those that whole workgroups add.
    pub fn of_picture(&self, extent: [u32; 2]) -> Option<Self> {
        let [width, height, depth] = self.size;
        let is_covered = |(side, (picture, group)): (u32, (u32, u32))| {
            picture <= side && u64::from(side) < u64::from(picture) + u64::from(group)
        };
        let group = match self.kind {
            PlaneKind::Launch => [1; 2],
            PlaneKind::Dispatch(group) => group,
        };
        let mut sides = [width, height].into_iter().zip(extent.into_iter().zip(group));
        (depth == 1 && sides.all(is_covered)).then_some(Self { extent, stride: width, ..*self })
    }

    /// The invocation of a pixel: its launch index or global invocation ID.
    pub fn id(&self, [x, y]: [u32; 2]) -> [u32; 3] {
        let at = u64::from(y) * u64::from(self.stride) + u64::from(x);
        let [width, height, _] = array::map(self.size, |side| u64::from(side.max(1)));
        array::map([at % width, at / width % height, at / width / height], |axis| axis as u32)
    }

    /// The pixel of an invocation, if it is on the plane.
    pub fn pixel(&self, [x, y, z]: [u32; 3]) -> Option<[u32; 2]> {
        let [width, height, depth] = self.size;
        if x >= width || y >= height || z >= depth {
            return None;
        }
        let [x, y, z] = [x, y, z].map(u64::from);
        let at = (z * u64::from(height) + y) * u64::from(width) + x;
        let stride = u64::from(self.stride);
        let pixel = [(at % stride) as u32, (at / stride) as u32];
        pixel.iter().zip(self.extent).all(|(&at, side)| at < side).then_some(pixel)
    }

    /// Number of components of an ID on the command line: 2 for a launch without depth, else 3.
    pub fn dimensions(&self) -> usize {
        if self.kind == PlaneKind::Launch && self.size[2] == 1 { 2 } else { 3 }
    }

    /// The ID of a pixel's invocation as the command line takes it: `3,4` or `3,4,0`.
    pub fn id_words(&self, pixel: [u32; 2]) -> String {
        self.id(pixel)[..self.dimensions()].iter().map(u32::to_string).collect::<Vec<_>>().join(",")
    }

    /// The number of invocations in words, such as `64 x 1 pixels`.
    pub fn size_words(&self) -> String {
        let sides = self.size[..self.dimensions()].iter().map(u32::to_string);
        format!("{} {}s", sides.collect::<Vec<_>>().join(" x "), self.kind.word())
    }

    /// Returns the numbers of its pixels, rows from the top, from those of all invocations in
    /// launch order.
    pub fn values(&self, all: &[f64]) -> Vec<f64> {
        let [width, height] = self.extent.map(|side| side as usize);
        let row = |y: usize| &all[y * self.stride as usize..][..width];
        (0..height).flat_map(row).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_of_a_depth_are_below_each_other() {
        let plane = InvocationPlane::of_launch([3, 2, 4]);
        assert_eq!(plane.extent, [3, 8]);
        // Row 5 is the second of the third slice.
        assert_eq!(plane.id([1, 5]), [1, 1, 2]);
        assert_eq!((plane.pixel([1, 1, 2]), plane.pixel([0, 2, 0])), (Some([1, 5]), None));
        assert_eq!((plane.id_words([1, 5]), plane.size_words()), ("1,1,2".into(), "3 x 2 x 4 pixels".into()));
        let flat = InvocationPlane::of_launch([64, 1, 1]);
        assert_eq!((flat.id_words([7, 0]), flat.size_words()), ("7,0".into(), "64 x 1 pixels".into()));
    }

    #[test]
    fn a_row_is_folded_along_workgroups() {
        // 1024 groups of 64 are 65,536 invocations: 256 x 256, four groups in a row.
        let plane = InvocationPlane::of_dispatch([65_536, 1, 1], [64, 1, 1]);
        assert_eq!((plane.extent, plane.id([5, 2])), ([256, 256], [517, 0, 0]));
        assert_eq!((plane.pixel([517, 0, 0]), plane.id_words([5, 2])), (Some([5, 2]), "517,0,0".into()));
        assert_eq!(plane.size_words(), "65536 x 1 x 1 invocations");
        // 224 invocations are 16 x 14, half a group of 32 in a row; 512 are as long as 32 x 16.
        let of = |count: u32, group: u32| InvocationPlane::of_dispatch([count, 1, 1], [group, 1, 1]).extent;
        assert_eq!((of(224, 32), of(512, 256), of(5, 1)), ([16, 14], [32, 16], [5, 1]));
        assert_eq!(InvocationPlane::of_dispatch([0, 1, 1], [64, 1, 1]).extent, [0, 1]);
        assert_eq!(InvocationPlane::of_dispatch([64, 64, 1], [8, 8, 1]).extent, [64, 64]);
    }

    #[test]
    fn a_picture_lacks_less_than_a_workgroup() {
        // 13 x 9 pixels take two workgroups of 8 in both directions.
        let plane = InvocationPlane::of_dispatch([16, 16, 1], [8, 8, 1]);
        let part = plane.of_picture([13, 9]).expect("a pixel for each invocation");
        assert_eq!((part.extent, part.id([12, 8])), ([13, 9], [12, 8, 0]));
        assert_eq!((part.pixel([12, 8, 0]), part.pixel([13, 8, 0])), (Some([12, 8]), None));
        let all: Vec<f64> = (0..256).map(f64::from).collect();
        let values = part.values(&all);
        assert_eq!((values.len(), values[12], values[13], values[116]), (117, 12.0, 16.0, 140.0));
        assert_eq!(plane.of_picture([8, 9]), None);
        assert_eq!(plane.of_picture([17, 16]), None);
        assert_eq!(InvocationPlane::of_launch([16, 16, 1]).of_picture([16, 15]), None);
        assert_eq!(InvocationPlane::of_launch([16, 16, 2]).of_picture([16, 16]), None);
    }
}
