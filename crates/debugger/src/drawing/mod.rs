//! Pictures of a ray: it, the boxes of the instances that it entered, and the primitives that were
//! tested, in world space.

mod obj;
mod raster;
mod svg;
mod view;

use std::f64::consts::TAU;

use crate::session::Session;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::accel::{Primitive, Tlas};
use anyhit_engine::math::array;
use anyhit_engine::reflect::value::FloatValue;
use anyhit_explain::summary_words::outcome;
use anyhit_explain::transcript::{InstanceOutcome, InstanceReport, PrimitiveOutcome, Transcript};
use anyhit_explain::walk::{self, AnyRay};

/// How many primitives are drawn; those that the ray meets come first.
const MAX_PRIMITIVES: usize = 200;
/// How many rays are drawn that followed from the ray.
const MAX_RAYS: usize = 24;
/// The points of a circle.
const CIRCLE: usize = 32;

/// A point of the world.
pub(super) type Point = [f64; 3];

/// A ray with what it was tested against.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// The ray, then those that followed from it.
    rays: Vec<DrawnRay>,
    boxes: Vec<DrawnBox>,
    primitives: Vec<DrawnPrimitive>,
}

#[derive(Clone, Debug, PartialEq)]
struct DrawnRay {
    from: Point,
    to: Point,
    is_hit: bool,
    label: String,
}

/// The box around an instance.
#[derive(Clone, Debug, PartialEq)]
struct DrawnBox {
    corners: [Point; 2],
    label: String,
    is_entered: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct DrawnPrimitive {
    shape: Shape,
    label: String,
    fate: PrimitiveFate,
}

/// What became of a primitive that was tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum PrimitiveFate {
    Hit,
    Met,
    Missed,
}

/// A primitive in world space, as lines or as a triangle.
#[derive(Clone, Debug, PartialEq)]
enum Shape {
    Triangle([Point; 3]),
    Lines(Vec<Vec<Point>>),
}

impl Shape {
    /// The lines of its outline.
    fn lines(&self) -> Vec<Vec<Point>> {
        match self {
            Self::Triangle([a, b, c]) => vec![vec![*a, *b, *c, *a]],
            Self::Lines(lines) => lines.clone(),
        }
    }
}

impl Session {
    /// The drawing of a ray that the outermost shader of a transcript traced, counted from 0.
    ///
    /// # Errors
    /// `InvalidArgument` where there is no such ray.
    pub fn drawing(&self, transcript: &Transcript, sample: usize) -> Result<Drawing> {
        let samples = walk::samples(&transcript.root);
        let root = *samples.get(sample).ok_or_else(|| {
            let count = samples.len();
            let message = format!("ray {sample} does not exist: the outermost shader traces {count}");
            Error::new(ErrorKind::InvalidArgument, message)
        })?;
        let rays = walk::rays(root);
        let Some(main) = rays.first().copied() else { return Ok(Drawing::empty()) };
        let mut drawing = Drawing::empty();
        drawing.rays.extend(rays.iter().take(MAX_RAYS + 1).copied().map(drawn_ray));
        let traversal = main.traversal();
        let name = traversal.structure.as_ref();
        let tlas = self.scene.tlas.iter().find(|(known, _)| Some(known) == name).map(|(_, tlas)| tlas);
        let time = traversal.time.map_or(0.0, FloatValue::as_f64) as f32;
        for instance in &traversal.instances {
            drawing.add_box(instance);
            if let Some(tlas) = tlas {
                drawing.add_primitives(main, instance, tlas, time);
            }
        }
        sort_by_key(&mut drawing.primitives, |primitive| primitive.fate);
        drawing.primitives.truncate(MAX_PRIMITIVES);
        Ok(drawing)
    }
}

impl Drawing {
    fn empty() -> Self {
        Self { rays: Vec::new(), boxes: Vec::new(), primitives: Vec::new() }
    }

    /// An SVG of it, seen along the axis of the world that its ray is most across to.
    pub fn svg(&self) -> String {
        svg::write(&view::View::of(self).picture(self))
    }

    /// A PNG of it, seen as in the SVG.
    ///
    /// # Errors
    /// As the writer of PNGs.
    pub fn png(&self) -> Result<Vec<u8>> {
        raster::image(&view::View::of(self).picture(self)).encode_png()
    }

    /// A Wavefront OBJ of it, with a named group for each part.
    pub fn obj(&self) -> String {
        obj::write(self)
    }

    fn add_box(&mut self, instance: &InstanceReport) {
        let Some(corners) = instance.bounds else { return };
        let names = match &instance.geometry[..] {
            [] => String::new(),
            names => format!(" `{}`", names.join("`, `")),
        };
        self.boxes.push(DrawnBox {
            corners: corners.map(|corner| corner.map(FloatValue::as_f64)),
            label: format!("instance {}{names}", instance.instance),
            is_entered: instance.verdict == InstanceOutcome::Entered,
        });
    }

    fn add_primitives(&mut self, ray: AnyRay<'_>, instance: &InstanceReport, tlas: &Tlas, time: f32) {
        let Some(placed) = tlas.instances().get(instance.instance as usize) else { return };
        let rows = placed.object_to_world(time).map(|row| row.map(f64::from));
        let to_world = |[x, y, z]: Point| rows.map(|[a, b, c, d]| a * x + b * y + c * z + d);
        let hit = ray.hit().map(|hit| [hit.instance, hit.geometry, hit.primitive]);
        for tested in &instance.tested {
            let Some(primitive) = placed.blas.primitive(tested.geometry, tested.primitive, time) else {
                continue;
            };
            let own = [instance.instance, tested.geometry, tested.primitive];
            let fate = match tested.verdict {
                _ if hit == Some(own) => PrimitiveFate::Hit,
                PrimitiveOutcome::Missed => PrimitiveFate::Missed,
                _ => PrimitiveFate::Met,
            };
            let at = tested.t.map_or_else(String::new, |t| format!(", t {t}"));
            let [instance, geometry, number] = own;
            self.primitives.push(DrawnPrimitive {
                shape: shape(&primitive, &to_world),
                label: format!("instance {instance} geometry {geometry} primitive {number}{at}"),
                fate,
            });
        }
    }
}

/// A ray from its origin to its hit, or past what it could hit.
fn drawn_ray(ray: AnyRay<'_>) -> DrawnRay {
    let traversal = ray.traversal();
    let from = traversal.origin.map(FloatValue::as_f64);
    let direction = traversal.direction.map(FloatValue::as_f64);
    let end = match ray.hit() {
        Some(hit) => hit.t.as_f64(),
        None => {
            let boxes = traversal.instances.iter().filter_map(|instance| instance.bounds);
            let past = boxes.flatten().map(|corner| along(from, direction, corner.map(FloatValue::as_f64)));
            let past = past.fold(0.0, f64::max) * 1.05;
            let past = if past > 0.0 { past } else { 1.0 / traversal.direction_length.as_f64().max(1e-30) };
            past.min(traversal.t_max.as_f64())
        }
    };
    let depth = match ray {
        AnyRay::Trace(trace) => format!("depth {}: ", trace.depth),
        AnyRay::Query(_) => "query: ".to_owned(),
    };
    DrawnRay {
        from,
        to: array::from_fn(|axis| from[axis] + end * direction[axis]),
        is_hit: ray.hit().is_some(),
        label: format!("{depth}{}", outcome(ray)),
    }
}

/// The t at which a ray is nearest to a point.
fn along(origin: Point, direction: Point, point: Point) -> f64 {
    let square: f64 = direction.iter().map(|x| x * x).sum();
    let dot: f64 = (0..3).map(|axis| (point[axis] - origin[axis]) * direction[axis]).sum();
    if square > 0.0 { dot / square } else { 0.0 }
}

fn shape(primitive: &Primitive, to_world: &dyn Fn(Point) -> Point) -> Shape {
    let wide = |point: &[f32; 3]| point.map(f64::from);
    let lines = match primitive {
        Primitive::Triangle(vertices) => {
            return Shape::Triangle(vertices.map(|vertex| to_world(wide(&vertex))));
        }
        Primitive::Aabb([x0, y0, z0, x1, y1, z1]) => {
            box_lines([wide(&[*x0, *y0, *z0]), wide(&[*x1, *y1, *z1])])
        }
        Primitive::Sphere { position, radius } => circles(wide(position), f64::from(*radius)),
        Primitive::LinearSweptSphere { positions, radii, .. } => {
            let [a, b] = positions.map(|position| wide(&position));
            let [r, s] = radii.map(f64::from);
            let mut lines = circles(a, r);
            lines.extend(circles(b, s));
            // Where the circles meet the axes, they are joined.
            for axis in 0..3 {
                for side in [-1.0, 1.0] {
                    let beside = |mut centre: Point, radius: f64| {
                        centre[axis] += side * radius;
                        centre
                    };
                    lines.push(vec![beside(a, r), beside(b, s)]);
                }
            }
            lines
        }
    };
    let place = |line: Vec<Point>| line.into_iter().map(to_world).collect();
    Shape::Lines(lines.into_iter().map(place).collect())
}

/// The great circles of a sphere across the three axes.
fn circles(centre: Point, radius: f64) -> Vec<Vec<Point>> {
    let circle = |axis: usize| {
        let point = |number: usize| {
            let angle = TAU * number as f64 / CIRCLE as f64;
            let mut point = centre;
            point[(axis + 1) % 3] += radius * angle.cos();
            point[(axis + 2) % 3] += radius * angle.sin();
            point
        };
        (0..=CIRCLE).map(point).collect()
    };
    (0..3).map(circle).collect()
}

/// The twelve edges of a box, in four lines.
fn box_lines([low, high]: [Point; 2]) -> Vec<Vec<Point>> {
    let corner = |bits: usize| -> Point {
        array::from_fn(|axis| if bits >> axis & 1 == 0 { low[axis] } else { high[axis] })
    };
    let face = |bits: [usize; 5]| bits.map(corner).to_vec();
    let mut lines = vec![face([0, 1, 3, 2, 0]), face([4, 5, 7, 6, 4])];
    lines.extend((0..4).map(|bits| vec![corner(bits), corner(bits + 4)]));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ray down the z axis onto a triangle in a box.
    pub(super) fn drawing() -> Drawing {
        Drawing {
            rays: vec![DrawnRay {
                from: [0.0, 0.0, 4.0],
                to: [0.0, 0.0, 0.0],
                is_hit: true,
                label: "depth 1: hit <a> & b".into(),
            }],
            boxes: vec![DrawnBox {
                corners: [[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]],
                label: "instance 0 `wall`".into(),
                is_entered: true,
            }],
            primitives: vec![DrawnPrimitive {
                shape: Shape::Triangle([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]),
                label: "instance 0 geometry 0 primitive 0, t 4".into(),
                fate: PrimitiveFate::Hit,
            }],
        }
    }

    #[test]
    fn a_box_has_twelve_edges() {
        let lines = box_lines([[0.0; 3], [1.0, 2.0, 3.0]]);
        let edges: usize = lines.iter().map(|line| line.len() - 1).sum();
        assert_eq!(edges, 12);
        // Every edge lies along one axis.
        for line in &lines {
            for pair in line.windows(2) {
                let moved = (0..3).filter(|&axis| pair[0][axis] != pair[1][axis]).count();
                assert_eq!(moved, 1, "{pair:?}");
            }
        }
    }

    #[test]
    fn circles_keep_their_radius() {
        for point in circles([1.0, 2.0, 3.0], 0.5).concat() {
            let squares: f64 = (0..3).map(|axis| (point[axis] - [1.0, 2.0, 3.0][axis]).powi(2)).sum();
            assert!((squares - 0.25).abs() < 1e-12, "{point:?}");
        }
    }

    #[test]
    fn the_nearest_point_of_a_ray() {
        assert_eq!(along([0.0; 3], [0.0, 0.0, 2.0], [5.0, 5.0, 6.0]), 3.0);
        assert_eq!(along([0.0; 3], [0.0; 3], [1.0; 3]), 0.0);
    }
}
