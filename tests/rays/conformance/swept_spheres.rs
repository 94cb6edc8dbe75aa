//! Spheres and linear swept spheres: indices, indexing modes, end caps, vertex and radius formats,
//! copies, traces and ray queries, in all combinations.
//!
//! The public suite's geometry: 16 centres or 8 segments in the plane z = -15 (z = 0 where the
//! format has two components), rays down the z axis at some of the centres. The numbers of hits
//! follow from which points are centres, or ends of segments with a cap.

use anyhit_engine::accel::build_input::{
    BuildInput, BuildRange, IndexType, RadiusFormat, Strided, VertexFormat,
};
use anyhit_engine::accel::{EndCaps, GeometryData, Indexing};
use anyhit_unit_test::scene::Instance;
use half::f16;

use crate::rays::conformance::rig::{Kind, MISS, Plan, Rig, SPHERE, SWEPT, Shot};

const RADII: [f32; 16] = [0.5, 0.6, 0.7, 0.8, 0.6, 0.5, 0.9, 0.4, 0.7, 0.6, 0.9, 0.5, 0.9, 0.6, 0.8, 0.5];
const CENTRES: [[f32; 2]; 16] = [
    [-8.0, 7.0],
    [7.0, 7.0],
    [6.0, 6.0],
    [-7.0, 5.0],
    [-8.0, 3.0],
    [4.0, 2.0],
    [6.0, 1.0],
    [-9.0, 1.0],
    [-6.0, 0.0],
    [5.0, -1.0],
    [8.0, -2.0],
    [-8.0, -3.0],
    [-6.0, -5.0],
    [7.0, -6.0],
    [5.0, -7.0],
    [-8.0, -6.0],
];

const FORMATS: [VertexFormat; 4] = [
    VertexFormat::R32G32B32Sfloat,
    VertexFormat::R32G32Sfloat,
    VertexFormat::R16G16B16Sfloat,
    VertexFormat::R16G16Sfloat,
];

/// Numbers in a format, with the z of the plane where it has one.
fn encode(points: &[[f32; 2]], format: VertexFormat) -> Vec<u8> {
    let three = [VertexFormat::R32G32B32Sfloat, VertexFormat::R16G16B16Sfloat].contains(&format);
    let half = [VertexFormat::R16G16B16Sfloat, VertexFormat::R16G16Sfloat].contains(&format);
    let numbers = points.iter().flat_map(|[x, y]| [*x, *y].into_iter().chain(three.then_some(-15.0)));
    numbers
        .flat_map(|x| if half { f16::from_f32(x).to_le_bytes().to_vec() } else { x.to_le_bytes().to_vec() })
        .collect()
}

fn encode_radii(radii: &[f32], format: RadiusFormat) -> Vec<u8> {
    let bytes = |r: &f32| match format {
        RadiusFormat::R32Sfloat => r.to_le_bytes().to_vec(),
        RadiusFormat::R16Sfloat => f16::from_f32(*r).to_le_bytes().to_vec(),
    };
    radii.iter().flat_map(bytes).collect()
}

/// What one row of the table is built from.
struct Row {
    name: &'static str,
    points: Vec<[f32; 2]>,
    radii: Vec<f32>,
    indices: Option<Vec<u32>>,
    shape: Shape,
    rays: Vec<[f32; 2]>,
    /// How many rays hit.
    hits: usize,
    two_components: bool,
}

#[derive(Clone, Copy)]
enum Shape {
    Spheres,
    Swept(Indexing, EndCaps),
}

fn rows() -> Vec<Row> {
    use EndCaps::{Chained, None as NoCaps};
    use Indexing::{List, Successive};
    let at = |order: &[usize]| order.iter().map(|&at| CENTRES[at]).collect::<Vec<_>>();
    let picked = at(&[15, 13, 11, 9, 7, 5, 3, 1, 2, 4, 6, 8]);
    // Points at x = +-8 and y from 7 down to -7, two a line: the segments lie apart from each
    // other.
    let ladder: Vec<[f32; 2]> =
        (0..16).map(|at| [if at % 2 == 0 { -8.0 } else { 8.0 }, 7.0 - 2.0 * (at / 2) as f32]).collect();
    let spheres = |name, indices, hits| Row {
        name,
        points: CENTRES.to_vec(),
        radii: RADII.to_vec(),
        indices,
        shape: Shape::Spheres,
        rays: picked.clone(),
        hits,
        two_components: true,
    };
    let capped = |name, indices, mode, hits| Row {
        name,
        points: ladder.clone(),
        radii: RADII.to_vec(),
        indices,
        shape: Shape::Swept(mode, Chained),
        rays: ladder[..12].to_vec(),
        hits,
        two_components: true,
    };
    // Radius 2 around the axis from x = 2 to 10; at x = 1 and 11 only caps would be met.
    let open = |name, indices, mode, points: &[[f32; 2]], hits| Row {
        name,
        points: points.to_vec(),
        radii: vec![2.0; points.len()],
        indices,
        shape: Shape::Swept(mode, NoCaps),
        rays: vec![[1.0, 0.0], [4.0, 1.0], [7.0, 1.0], [9.0, 1.0], [11.0, 0.0]],
        hits,
        two_components: false,
    };
    let line = [[2.0, 0.0], [6.0, 0.0], [10.0, 0.0]];
    vec![
        spheres("spheres.vertices", None, 12),
        // Of the 12 rays the first 8 are at indexed centres.
        spheres("spheres.indices", Some(vec![15, 13, 11, 9, 7, 5, 3, 1]), 8),
        // All of the points 0 to 11 are ends.
        capped("lss.vertices", None, List, 12),
        // Segments between even points: 0-2, 2-4, 4-6, 8-10, 10-12, 12-14, on the line x = -8. Of
        // the rays, 0 2 4 6 8 10 are at their ends, and the odd points are 16 away.
        capped("lss.list", Some(vec![0, 2, 2, 4, 4, 6, 8, 10, 10, 12, 12, 14]), List, 6),
        // Segments 0-1 ... 4-5 and 8-9 ... 14-15: of the points 0 to 11 only 6 and 7 are no ends.
        capped("lss.successive", Some(vec![0, 1, 2, 3, 4, 8, 9, 10, 11, 12, 13, 14]), Successive, 10),
        // One segment from 2 to 6 without caps: the ray at x = 4 alone.
        open("lss.vertices.open", None, List, &line, 1),
        open("lss.list.open", Some(vec![0, 1]), List, &line, 1),
        // Segments 2-6 and 6-10: the rays at 4, 7 and 9.
        open("lss.successive.open", Some(vec![0, 1]), Successive, &line, 3),
    ]
}

/// The geometry of a row, from buffers in the formats.
fn build(row: &Row, format: VertexFormat, radius_format: RadiusFormat) -> GeometryData {
    let vertices = encode(&row.points, format);
    let radii = encode_radii(&row.radii, radius_format);
    let index_bytes: Option<Vec<u8>> =
        row.indices.as_ref().map(|all| all.iter().flat_map(|index| index.to_le_bytes()).collect());
    let packed = |bytes| Strided { bytes, stride: None };
    let input = BuildInput {
        vertices: packed(&vertices),
        vertex_format: format,
        indices: index_bytes.as_deref().map(|bytes| (packed(bytes), IndexType::Uint32)),
        range: BuildRange::default(),
    };
    let data = match row.shape {
        Shape::Spheres => input.spheres(packed(&radii), radius_format),
        Shape::Swept(mode, caps) => input.linear_swept_spheres(packed(&radii), radius_format, mode, caps),
    };
    data.expect("a valid geometry")
}

/// The rays that a way of asking finds to hit: a trace through hit groups, or a ray query.
fn hits(way: &'static str, data: GeometryData, rays: &[[f32; 2]], wanted: u32) -> usize {
    let shots: Vec<Shot> =
        rays.iter().map(|[x, y]| Shot { t_min: 0.001, t_max: 1000.0, ..Shot::down([*x, *y, 1.0]) }).collect();
    let rig = Rig::with([(Kind::Swept, Plan::default())]).raygen(way);
    let probes = rig.run([Instance::of(data)], &shots);
    for probe in &probes {
        assert!(probe.stage == MISS || probe.stage == wanted, "{way}: {probe:?}");
        assert_eq!(probe.never, 0);
    }
    probes.iter().filter(|probe| probe.stage == wanted).count()
}

/// All rows in all formats, from the structure as built and from a copy, by every way of asking.
#[test]
fn hits_are_counted_in_every_combination() {
    let mut behaviours = 0;
    for way in crate::rays::conformance::rig::WAYS {
        for row in rows() {
            let stage = if matches!(row.shape, Shape::Spheres) { SPHERE } else { SWEPT };
            for format in FORMATS {
                let two = [VertexFormat::R32G32Sfloat, VertexFormat::R16G16Sfloat].contains(&format);
                if two && !row.two_components {
                    continue;
                }
                for radius_format in [RadiusFormat::R32Sfloat, RadiusFormat::R16Sfloat] {
                    for copies in [false, true] {
                        let data = build(&row, format, radius_format);
                        // What a copied structure holds is what the first one holds.
                        let data = if copies { data.clone() } else { data };
                        let found = hits(way, data, &row.rays, stage);
                        let what = (way, row.name, format, radius_format, copies);
                        assert_eq!(found, row.hits, "{what:?}");
                        behaviours += 1;
                    }
                }
            }
        }
    }
    // 2 of spheres and 3 capped ones in 8 formats, 3 open ones in 4, each built and copied.
    assert_eq!(behaviours, crate::rays::conformance::rig::WAYS.len() * (5 * 8 + 3 * 4) * 2);
}

/// Positions and radii come back bit for bit; halves widened exactly.
#[test]
fn positions_and_radii_are_those_of_the_build() {
    for way in crate::rays::conformance::rig::WAYS {
        for half in [false, true] {
            let (format, radius_format) = match half {
                true => (VertexFormat::R16G16B16Sfloat, RadiusFormat::R16Sfloat),
                false => (VertexFormat::R32G32B32Sfloat, RadiusFormat::R32Sfloat),
            };
            let stored = |x: f32| if half { f16::from_f32(x).to_f32() } else { x };
            let row = &rows()[0];
            let rig = Rig::with([(Kind::Swept, Plan::default())]).raygen(way);
            let shots: Vec<Shot> =
                CENTRES.iter().map(|[x, y]| Shot { t_max: 1000.0, ..Shot::down([*x, *y, 1.0]) }).collect();
            let probes = rig.run([Instance::of(build(row, format, radius_format))], &shots);
            for (at, probe) in probes.iter().enumerate() {
                let [x, y] = CENTRES[at];
                assert_eq!(probe.vertices[0], [x, y, -15.0]);
                assert_eq!((probe.primitive, probe.attribute[1]), (at as u32, stored(RADII[at])));
            }
            let row = &rows()[2];
            let probes = rig.run([Instance::of(build(row, format, radius_format))], &shots[..1]);
            let probe = probes[0];
            // Radii r0 = 0.5 and r1 = 0.6, 16 apart: the side begins before the first centre, and
            // above that centre u = r0 (r1 - r0) / (16^2 - (r1 - r0)^2).
            let (r0, r1) = (f64::from(stored(0.5)), f64::from(stored(0.6)));
            let u = r0 * (r1 - r0) / (256.0 - (r1 - r0) * (r1 - r0));
            assert_eq!(probe.vertices[..2], [[-8.0, 7.0, -15.0], [8.0, 7.0, -15.0]]);
            assert_eq!(probe.attribute[1..3], [stored(0.5), stored(0.6)]);
            assert!((f64::from(probe.attribute[0]) - u).abs() < 1e-9, "{}", probe.attribute[0]);
        }
    }
}

/// u is the parameter of the generating sphere: exactly 0 or 1 on the caps, between on the side.
#[test]
fn u_tells_caps_from_the_side() {
    let data = |radii: [f32; 2]| GeometryData::LinearSweptSpheres {
        positions: vec![[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        radii: radii.to_vec(),
        indices: None,
        indexing: Indexing::List,
        end_caps: EndCaps::Chained,
    };
    for way in crate::rays::conformance::rig::WAYS {
        let at = |radii: [f32; 2], x: f32| {
            let rig = Rig::with([(Kind::Swept, Plan::default())]).raygen(way);
            rig.run([Instance::of(data(radii))], &[Shot::down([x, 0.0, 4.0])])[0].attribute[0]
        };
        assert_eq!([at([1.0, 1.0], -2.5), at([1.0, 1.0], 2.5)], [0.0, 1.0]);
        assert_eq!([at([1.0, 1.0], -1.0), at([1.0, 1.0], 1.5)], [0.25, 0.875]);
        // A cone from 1 to 1/2: sin a = (1 - 1/2) / 4 = 1/8. Above x the side's height is
        // r(u) cos a, and its point lies r(u) sin a from its generating centre towards the thin
        // end: x = -2 + 4 u + r(u) / 8 with r(u) = 1 - u / 2, so u = (x + 2 - 1/8) / (4 - 1/16).
        let u = at([1.0, 0.5], 0.0);
        assert!((u - (2.0 - 0.125) / 3.9375).abs() < 1e-7, "{u}");
        // At x = -2 + 1/8 the side begins: the ray at the centre itself still meets the cap.
        assert_eq!(at([1.0, 0.5], -2.0), 0.0);
    }
}

/// Degenerate ones: radius 0, NaN, one end within the other, a point for an axis.
#[test]
fn degenerate_primitives() {
    let found = |positions: [[f32; 3]; 2], radii: [f32; 2]| {
        let data = GeometryData::LinearSweptSpheres {
            positions: positions.to_vec(),
            radii: radii.to_vec(),
            indices: None,
            indexing: Indexing::List,
            end_caps: EndCaps::Chained,
        };
        let probe = Rig::of(Kind::Swept).run([Instance::of(data)], &[Shot::down([0.0, 0.0, 4.0])])[0];
        (probe.stage == SWEPT).then_some((probe.t_max, probe.attribute[0]))
    };
    let axis = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
    assert_eq!(found(axis, [0.0, 0.0]), None);
    assert_eq!(found(axis, [f32::NAN, 1.0]), None);
    assert_eq!(found([[f32::NAN, 0.0, 0.0], [1.0, 0.0, 0.0]], [1.0, 1.0]), None);
    // The sphere of radius 3 around (1, 0, 0) holds the other: z^2 = 9 - 1, u is its end's.
    assert_eq!(found(axis, [0.5, 3.0]), Some((4.0 - 8f32.sqrt(), 1.0)));
    // Both ends at one place: the larger sphere.
    assert_eq!(found([[0.0; 3]; 2], [2.0, 1.0]), Some((2.0, 0.0)));
    // A cone's apex of radius 0 is a legal end.
    assert!(found(axis, [0.0, 1.0]).is_some());
    let sphere = |radius| {
        let probe =
            Rig::of(Kind::Swept).run([Instance::sphere([0.0; 3], radius)], &[Shot::down([0.0, 0.0, 4.0])]);
        probe[0].stage
    };
    assert_eq!([sphere(0.0), sphere(f32::NAN), sphere(1.0)], [MISS, MISS, SPHERE]);
}

/// A ray from inside finds nothing, not even the far side; nor does one through a missing cap.
#[test]
fn only_entries_are_hits() {
    let capsule = |end_caps| {
        Instance::of(GeometryData::LinearSweptSpheres {
            positions: vec![[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
            radii: vec![1.0; 2],
            indices: None,
            indexing: Indexing::List,
            end_caps,
        })
    };
    for way in crate::rays::conformance::rig::WAYS {
        let stage = |caps, origin, direction| {
            let rig = Rig::with([(Kind::Swept, Plan::default())]).raygen(way);
            rig.run([capsule(caps)], &[Shot { direction, ..Shot::down(origin) }])[0].stage
        };
        assert_eq!(stage(EndCaps::Chained, [0.0; 3], [0.0, 0.0, -1.0]), MISS);
        assert_eq!(stage(EndCaps::Chained, [-2.5, 0.0, 0.0], [1.0, 0.0, 0.0]), MISS);
        assert_eq!(stage(EndCaps::Chained, [-5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), SWEPT);
        // In through the open end, and out through the wall.
        assert_eq!(stage(EndCaps::None, [-5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), MISS);
        assert_eq!(stage(EndCaps::None, [-3.5, 0.0, 0.0], [1.0, 0.0, 0.25]), MISS);
        assert_eq!(stage(EndCaps::None, [0.0, 0.0, 3.0], [0.0, 0.0, -1.0]), SWEPT);
    }
}

/// Sheared, scaled and mirrored instances: t counts the same, the builtins stay in object space.
#[test]
fn instances_are_sheared_and_mirrored() {
    let segment = Instance::lss([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]], [0.5, 0.25]);
    // x scaled by -4, z sheared by x: at object x = 0 the depth is that of the capsule itself.
    let matrix = [[-4.0, 0.0, 0.0, 3.0], [0.0, 1.0, 0.0, 0.0], [0.5, 0.0, 1.0, 0.0]];
    for way in crate::rays::conformance::rig::WAYS {
        let rig = Rig::with([(Kind::Swept, Plan::default())]).raygen(way);
        let [straight] = rig.run([segment.clone()], &[Shot::down([0.0, 0.5, 2.0])])[..] else { panic!() };
        let [placed] = rig.run([segment.clone().transform(matrix)], &[Shot::down([3.0, 0.5, 2.0])])[..]
        else {
            panic!()
        };
        assert_eq!(
            (placed.stage, placed.t_max, placed.attribute),
            (SWEPT, straight.t_max, straight.attribute)
        );
        assert_eq!(placed.vertices, straight.vertices);
        // World x = 4.5 is object x = (3 - 4.5) / 4 = -0.375: within the radius of 1/2 at y = -1,
        // where 1.5 would be far outside.
        let [beside] = rig.run([segment.clone().transform(matrix)], &[Shot::down([4.5, -1.0, 2.0])])[..]
        else {
            panic!()
        };
        assert_eq!(beside.stage, SWEPT);
    }
}
