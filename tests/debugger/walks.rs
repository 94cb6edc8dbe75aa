//! The debugger finds planted bugs: those of `shaders/debugging`, each in six commands or fewer,
//! which `tests/debugger/scripts/bug-*.stdin` hold. `docs/debugging.md` shows the transcripts.

use std::path::Path;

use pretty_assertions::assert_eq;

use crate::debugger::console::{tells, transcript};

/// The bugs, in the order of the guide.
const BUGS: [&str; 7] = [
    "normal-transform",
    "t-min",
    "sbt-offset",
    "unwritten-payload",
    "signed-hash",
    "negative-pow",
    "swapped-barycentrics",
];

/// The slope has the normal (1, 1, 0) / sqrt(2), and is scaled by (4, 3, 1). By the matrix that
/// becomes (4, 3, 0) / 5; by the transpose of its inverse (1/4, 1/3, 0), normalised (3, 4, 0) / 5.
/// Along the slope it goes by (4, -3, 0): (0.8, 0.6, 0) . (4, -3, 0) = 3.2 - 1.8, and not 0.
#[test]
fn a_normal_that_the_wrong_matrix_moved() {
    tells(
        &transcript("bug-normal-transform"),
        &[
            "normal = vec3(0.8, 0.6, 0)\n",
            "dot(normal, vec3(4, -3, 0)) = float 1.4",
            "who normal\n",
            "normal = vec3(0.8, 0.6, 0)\n",
            "roof.rchit:15",
            "rstep\nworld_normal at shaders/debugging/normal-transform/roof.rchit:11",
            "mat3(gl_ObjectToWorldEXT) * object_normal",
            " = vec3(0.6, 0.8, 0)\n",
        ],
    );
}

/// From y = 2 the floor at f32(0.4) = 0.4 + 5.96e-9 is 1.6 - 5.96e-9 away. The nearest f32 is
/// 1.6 + 2.38e-8, and 2 less that is 0.4 - 2.38e-8: the f32 below f32(0.4), by 2^-25 = 2.98e-8. Up
/// to the floor it is 2^-25 / 0.8 = 3.725e-8 along the ray.
#[test]
fn a_shadow_ray_that_meets_the_surface_it_starts_at() {
    tells(
        &transcript("bug-t-min"),
        &[
            "light = float 0\n",
            "rtraversal\n",
            "the closest hit: instance 0, primitive ",
            "at t 0.0000000372529",
            "hit.y = float 0.39999998\n",
            "hit.y < 0.4 = bool true\n",
        ],
    );
}

/// The record of geometry 1 is offset 0 + 1 x stride 1 = 1, which is the wall's shadow; with a
/// stride of 2 it would be 2, the window.
#[test]
fn a_hit_group_of_another_geometry() {
    tells(
        &transcript("bug-sbt-offset"),
        &[
            "shadow.rchit:14  ClosestHitKHR",
            "gl_GeometryIndexEXT = int 1\n",
            "the closest hit: instance 0, primitive 0 at t 5, hit record 1\n",
            "up\nmain at shaders/debugging/sbt-offset/main.rgen:20",
            "stride = uint 1\n",
        ],
    );
}

/// The first ray meets the ball of radius 1 from z = 4 at t = 3; the second misses, and the sky
/// writes the colour (0, 0, 1) alone.
#[test]
fn a_member_of_a_payload_that_a_miss_shader_leaves() {
    tells(
        &transcript("bug-unwritten-payload"),
        &[
            "breakpoint 1\n",
            "main.rgen:23",
            "payload = Payload { colour: vec3(0, 0, 1), distance: float 3 }\n",
            "who payload.distance\n",
            "payload.distance = float 3\n",
            "ball.rchit:14  ClosestHitKHR",
            "up\nmain at shaders/debugging/unwritten-payload/main.rgen:21",
            "sample_index = int 0\n",
        ],
    );
}

/// 30 x 73856093 = 2215682790, which is above 2^31: as an int -2079284506. Its nearest f32 is
/// -2079284480; through 2^31 that is -0.9682423.
#[test]
fn a_hash_that_is_negative() {
    tells(
        &transcript("bug-signed-hash"),
        &[
            "random = float -0.9682423\n",
            "who random\n",
            "main.rgen:17",
            "rstep\nhash at shaders/debugging/signed-hash/main.rgen:11",
            "= int -2079284506\n",
            "= uint 2215682790\n",
        ],
    );
}

/// The ray along -z meets the unit ball at (0, 0, 1), where the normal is (0, 0, 1) and so is the
/// mirrored direction. To the lamp it is (0, 3, -4) / 5, and the product -0.8.
#[test]
fn a_power_of_a_negative_number() {
    tells(
        &transcript("bug-negative-pow"),
        &[
            "nan\nthe previous step produced the first NaN\n",
            "highlight at shaders/debugging/negative-pow/ball.rchit:12",
            "mirrored = vec3(0, 0, 1)\n",
            "to_lamp = vec3(0, 0.6, -0.8)\n",
            "dot(mirrored, to_lamp) = float -0.8\n",
            "up\nmain at shaders/debugging/negative-pow/ball.rchit:20",
            "dot(normal, to_lamp) = float -0.8\n",
        ],
    );
}

/// At (2, 1, 0) of the triangle (0, 0, 0), (4, 0, 0), (0, 4, 0) u is 1/2 and v 1/4, so the corners
/// count 1/4, 1/2 and 1/4. In the order (u, v, 1 - u - v) they come to (1/4 x 4, 1/4 x 4, 0).
/// With the right weights the colour is 1/4 red, 1/2 green and 1/4 blue.
#[test]
fn weights_of_corners_in_the_wrong_order() {
    tells(
        &transcript("bug-swapped-barycentrics"),
        &[
            "flag.rchit:13",
            "= vec3(2, 1, 0)\n",
            "= vec3(1, 1, 0)\n",
            "weights = vec3(0.25, 0.5, 0.25)\n",
            "main.rgen:13",
            "colour = vec3(0.25, 0.5, 0.25)\n",
        ],
    );
}

#[test]
fn a_walk_is_short() {
    for bug in BUGS {
        let path = format!("{}/tests/debugger/scripts/bug-{bug}.stdin", env!("CARGO_MANIFEST_DIR"));
        let script = std::fs::read_to_string(path).expect("the script is there");
        let count = script.lines().filter(|line| !line.starts_with('#')).count();
        assert!(count <= 6, "{bug}: {count} commands");
    }
}

/// `docs/debugging.md` shows how each walk is started, and its transcript.
#[test]
fn the_guide_shows_the_walks() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = root.join("docs/debugging.md");
    let mut guide = std::fs::read_to_string(&path).expect("the guide");
    for bug in BUGS {
        let begin = format!("<!-- bug-{bug}.stdout -->\n");
        let (before, rest) = guide.split_once(&begin).expect("the place where the transcript begins");
        let (shown, after) = rest.split_once("<!-- end -->").expect("the place where it ends");
        let script = root.join(format!("tests/debugger/scripts/bug-{bug}.stdin"));
        let script = std::fs::read_to_string(script).expect("the script is there");
        let arguments = script.lines().next().and_then(|line| line.strip_prefix("# trace-one-ray "));
        let arguments = arguments.expect("a line of arguments");
        let told = transcript(&format!("bug-{bug}"));
        let block = format!("```text\n$ anyhit trace-one-ray --interactive {arguments}\n{told}```\n");
        if std::env::var_os("BLESS").is_none() {
            assert_eq!(shown, block, "{bug}: `BLESS=1 cargo test` if the new form is meant");
        }
        guide = [before, &begin, &block, "<!-- end -->", after].concat();
    }
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, guide).expect("the guide");
    }
}
