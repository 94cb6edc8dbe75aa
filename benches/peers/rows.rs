//! The rows of the comparison: one measured here, one at a peer.

use anyhit_engine::accel::GeometryFlags;

use crate::installed::{Installed, Printed};
use crate::scene_files::PICTURE;
use crate::table::{Measured, Table};
use crate::{frames, obvhs, scenes, traverse};

/// The greatest difference of the numbers of hits, for each thousand pixels: the intersections of
/// the peers are not exact.
const MAX_HIT_DIFFERENCE: f64 = 1.0;

/// A comparison.
pub struct Row {
    pub name: &'static str,
    ours: Ours,
    pub peer: Peer,
    pub unit: Unit,
    /// The ratio that this project wants to reach.
    pub wanted: f64,
}

/// What is measured in this crate.
enum Ours {
    /// A row of `benches/speed`.
    Frame(&'static str),
    Traverse(&'static str),
    Build(fn() -> scenes::Scene),
}

/// What is measured at a peer.
pub enum Peer {
    /// A scene and the shaders of a launch, which prints `rate` and `hits`.
    Lavapipe(&'static str, &'static [&'static str]),
    /// A scene, traced by single rays or by packets of eight.
    Embree(&'static str, Rays),
    EmbreeBuild(&'static str),
    LavapipeFirstLaunch,
    /// Rays over the terrain.
    Obvhs,
}

pub enum Rays {
    Single,
    Packets,
}

#[derive(Clone, Copy)]
pub enum Unit {
    /// Millions of rays or pixels a second of processor time.
    Rate,
    Milliseconds,
}

/// The result of one round.
pub struct RoundResult {
    pub ours: f64,
    pub theirs: f64,
}

const LIGHT: &[&str] = &["primary.rgen", "sky.rmiss", "light.rchit"];

/// The rows of the table.
pub const ROWS: &[Row] = &[
    launch("triangles, light closest-hit", "frame triangles light", "terrain", LIGHT, 4.5 / 3.5),
    launch(
        "triangles, heavy closest-hit",
        "frame triangles heavy",
        "terrain",
        &["primary.rgen", "sky.rmiss", "heavy.rchit"],
        1.0,
    ),
    launch(
        "triangles, any-hit",
        "frame triangles any-hit",
        "terrain",
        &["primary.rgen", "sky.rmiss", "light.rchit", "alpha.rahit"],
        3.5 / 2.9,
    ),
    launch(
        "triangles and a shadow ray",
        "frame triangles and shadow",
        "terrain",
        &["shadow.rgen", "sky.rmiss", "shadow.rmiss", "light.rchit"],
        3.0 / 2.2,
    ),
    launch("64 instances, light closest-hit", "frame 64 instances", "tiled", LIGHT, 3.0 / 1.6),
    launch("ray query in compute", "frame ray query", "terrain", &["query.comp"], 4.5 / 4.0),
    launch(
        "spheres; there by an intersection shader",
        "frame spheres",
        "spheres",
        &["primary.rgen", "sky.rmiss", "sphere.rchit", "sphere.rint"],
        5.0 / 3.3,
    ),
    launch(
        "swept spheres; there by an intersection shader",
        "frame swept spheres",
        "meadow",
        &["primary.rgen", "sky.rmiss", "sphere.rchit", "swept.rint"],
        3.0,
    ),
    launch(
        "arithmetic alone",
        "frame arithmetic",
        "terrain",
        &["arithmetic.rgen", "sky.rmiss", "light.rchit"],
        1.0,
    ),
    traversal(
        "triangles, traversal alone",
        "traverse triangles together",
        "terrain",
        Rays::Single,
        10.0 / 10.7,
    ),
    traversal(
        "triangles, beside packets of 8",
        "traverse triangles together",
        "terrain",
        Rays::Packets,
        10.0 / 14.6,
    ),
    traversal("triangles, one ray at a time", "traverse triangles", "terrain", Rays::Single, 10.0 / 10.7),
    traversal(
        "triangles, one ray at a time in random order",
        "traverse triangles shuffled",
        "terrain-shuffled",
        Rays::Single,
        10.0 / 10.7,
    ),
    traversal(
        "triangles, packets of 8 in random order",
        "traverse triangles shuffled together",
        "terrain-shuffled",
        Rays::Packets,
        10.0 / 14.6,
    ),
    traversal(
        "64 instances, traversal alone",
        "traverse 64 instances together",
        "tiled",
        Rays::Single,
        3.0 / 5.5,
    ),
    traversal("spheres, traversal alone", "traverse spheres together", "spheres", Rays::Single, 9.0 / 7.6),
    traversal(
        "swept spheres, traversal alone",
        "traverse swept spheres together",
        "meadow",
        Rays::Single,
        3.9 / 3.6,
    ),
    Row {
        name: "triangles, beside BVH2 of obvhs",
        ours: Ours::Traverse("traverse triangles together"),
        peer: Peer::Obvhs,
        unit: Unit::Rate,
        wanted: 10.0 / 6.0,
    },
    build("build of 131,072 triangles", || scenes::heightfield(256), "terrain", 31.0 / 30.0),
    build("build of 30,090 swept spheres", || scenes::meadow(30_000), "meadow", 1.0),
    Row {
        name: "pipeline and first launch of 8 x 8",
        ours: Ours::Frame("first launch"),
        peer: Peer::LavapipeFirstLaunch,
        unit: Unit::Milliseconds,
        wanted: 80.0 / 5.0,
    },
];

const fn launch(
    name: &'static str,
    ours: &'static str,
    scene: &'static str,
    shaders: &'static [&'static str],
    wanted: f64,
) -> Row {
    Row { name, ours: Ours::Frame(ours), peer: Peer::Lavapipe(scene, shaders), unit: Unit::Rate, wanted }
}

const fn traversal(
    name: &'static str,
    ours: &'static str,
    scene: &'static str,
    rays: Rays,
    wanted: f64,
) -> Row {
    Row { name, ours: Ours::Traverse(ours), peer: Peer::Embree(scene, rays), unit: Unit::Rate, wanted }
}

const fn build(name: &'static str, make: fn() -> scenes::Scene, scene: &'static str, wanted: f64) -> Row {
    Row { name, ours: Ours::Build(make), peer: Peer::EmbreeBuild(scene), unit: Unit::Milliseconds, wanted }
}

impl Unit {
    pub fn name(self) -> &'static str {
        match self {
            Self::Rate => "M/s",
            Self::Milliseconds => "ms",
        }
    }
}

impl Peer {
    pub fn name(&self) -> &'static str {
        match self {
            Self::Lavapipe(..) | Self::LavapipeFirstLaunch => "lavapipe",
            Self::Embree(..) | Self::EmbreeBuild(_) => "Embree",
            Self::Obvhs => "obvhs",
        }
    }

    fn measure(&self, installed: &Installed) -> Result<Measured, String> {
        let [width, height] = PICTURE.map(|side| side.to_string());
        let (printed, value): (Printed, &str) = match self {
            Self::Obvhs => return Ok(obvhs::triangles()),
            Self::Lavapipe(scene, shaders) => {
                let (scene, shaders) = (folder(scene), modules(shaders));
                let shaders = shaders.iter().map(String::as_str);
                let words: Vec<&str> = [&*scene, &width, &height].into_iter().chain(shaders).collect();
                (installed.lavapipe(true, &words)?, "rate")
            }
            Self::LavapipeFirstLaunch => {
                let (scene, shaders) = (folder("terrain"), modules(LIGHT));
                let shaders = shaders.iter().map(String::as_str);
                let words: Vec<&str> = [&*scene, "8", "8"].into_iter().chain(shaders).collect();
                (installed.lavapipe(false, &words)?, "first_launch")
            }
            Self::Embree(scene, Rays::Single) => (installed.embree(&[&folder(scene), "1"])?, "rate"),
            Self::Embree(scene, Rays::Packets) => (installed.embree(&[&folder(scene), "8"])?, "rate"),
            Self::EmbreeBuild(scene) => (installed.embree(&[&folder(scene), "0"])?, "build"),
        };
        let number = |name: &str| printed.get(name).copied();
        let value = number(value).ok_or_else(|| format!("no `{value}` in {printed:?}"))?;
        let counted = matches!(self, Self::Lavapipe(..) | Self::Embree(..));
        Ok(Measured { value, hits: number("hits").filter(|_| counted).map(|hits| hits as u64) })
    }
}

fn folder(scene: &str) -> String {
    format!("/share/scenes/{scene}")
}

fn modules(shaders: &[&str]) -> Vec<String> {
    shaders.iter().map(|shader| format!("/share/shaders/{shader}.spv")).collect()
}

impl Ours {
    fn measure(&self) -> Measured {
        let last = |mut table: Table, run: fn(&mut Table)| {
            run(&mut table);
            table.into_last().expect("a row of this name")
        };
        match *self {
            Self::Frame(name) => last(Table::of_one(name, PICTURE), frames::run),
            Self::Traverse(name) => last(Table::of_one(name, PICTURE), traverse::run),
            Self::Build(make) => {
                let (table, scene) = (Table::of_one("build", PICTURE), make());
                table.time("build", || format!("{:?}", scene.built(GeometryFlags::OPAQUE).bounds().max));
                table.into_last().expect("a row")
            }
        }
    }
}

impl Row {
    /// Measures one round.
    pub fn measure(&self, installed: &Installed) -> Result<RoundResult, String> {
        let ours = self.ours.measure();
        let theirs = self.peer.measure(installed)?;
        if let (Some(here), Some(there)) = (ours.hits, theirs.hits) {
            let pixels = f64::from(PICTURE[0] * PICTURE[1]);
            if here.abs_diff(there) as f64 > MAX_HIT_DIFFERENCE / 1000.0 * pixels {
                return Err(format!("{here} pixels hit here, {there} there: this is not the same work"));
            }
        }
        Ok(RoundResult { ours: ours.value, theirs: theirs.value })
    }
}
