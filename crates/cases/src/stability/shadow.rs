//! The f64 shadow: every float operation is executed a second time in f64.
//!
//! Each register that holds a float has a shadow value, the one that f64 arithmetic would have
//! computed. It follows the value through variables, calls, payloads, callable data, hit attributes
//! and buffers. Values from elsewhere (constants, builtins, textures, results of ray queries and
//! atomic instructions) are their own shadows. The shadow does not change the run: if a comparison
//! of shadow values has a different result, it is counted, and control flow follows the run.

use crate::observe::fresh_resources;
use crate::stability::found::ShadowFindings;
use crate::stability::probe;
use crate::stability::shadow_context::ShadowContext;
use crate::stability::shadow_interpreter::ShadowInterpreter;
use anyhit_base::error::{Error, Result};
use anyhit_base::progress::Work;
use anyhit_debugger::session::ResolvedRequest;
use anyhit_scene::frame::SinglePass;
use anyhit_scene::{Assembled, ResolvedScene};

/// Runs a scene's passes on a copy of its resources, with shadows. Returns
/// the findings, and the trap that ended the run, if there is one.
///
/// # Errors
/// `UnsupportedModule` where invocations cannot run one by one.
pub fn shadow(scene: &ResolvedScene, assembled: &Assembled) -> Result<(ShadowFindings, Option<Error>)> {
    let context = ShadowContext::new(scene, assembled);
    let resources = fresh_resources(assembled);
    let mut sum = ShadowFindings::default();
    let outcome = probe::run(
        assembled,
        &resources,
        &|| ShadowInterpreter::new(&context),
        &mut |interpreter: ShadowInterpreter<'_>| {
            sum.add(&interpreter.findings());
            context.memory().extend(interpreter.memory);
        },
    );
    trap_of(outcome).map(|trap| (sum, trap))
}

/// Runs a scene's passes as [`shadow`] does. Returns the size of one of its passes, and for each of
/// its invocations how far what it writes to images is from f64 arithmetic: the greatest error of a
/// float component, before it is converted to the image's format, in units in the last place of an
/// f32. Where a number is not finite on one of the two sides there is nothing to compare: it has no
/// error.
///
/// # Errors
/// As [`shadow`], and the first trap.
pub fn texel_errors(
    scene: &ResolvedScene,
    assembled: &Assembled,
    single: &SinglePass<'_>,
) -> Result<([u32; 3], Vec<f64>)> {
    let _work = Work::new("measuring rounding errors");
    let context = ShadowContext::new(scene, assembled);
    let resources = fresh_resources(assembled);
    let mut found = Vec::new();
    probe::run(
        assembled,
        &resources,
        &|| ShadowInterpreter::new(&context),
        &mut |interpreter: ShadowInterpreter<'_>| {
            let errors = interpreter.texel_errors.iter().filter(|texel| texel.pass == single.number());
            found.extend(errors.map(|texel| (texel.id, texel.ulps)));
            context.memory().extend(interpreter.memory);
        },
    )?;
    let size = single.size_in(assembled, &resources);
    let [width, height, depth] = size.map(|side| side as usize);
    let mut errors = vec![0.0_f64; width * height * depth];
    for (id, ulps) in found {
        let [x, y, z] = id.map(|axis| axis as usize);
        // A later pass may have changed a size that a buffer holds.
        if let Some(error) = errors.get_mut((z * height + y) * width + x).filter(|_| x < width && y < height)
        {
            *error = error.max(ulps);
        }
    }
    Ok((size, errors))
}

/// Runs one ray or one invocation of ray generation with f64 shadows.
///
/// # Errors
/// As [`shadow`], and where the ray does not fit the scene.
pub fn shadow_one(
    scene: &ResolvedScene,
    assembled: &Assembled,
    which: &ResolvedRequest,
) -> Result<(ShadowFindings, Option<Error>)> {
    let context = ShadowContext::new(scene, assembled);
    let resources = fresh_resources(assembled);
    let interpreter = ShadowInterpreter::new(&context);
    let (interpreter, outcome) =
        probe::run_one(scene, assembled, &resources, which, interpreter, &mut |_| ())?;
    trap_of(outcome).map(|trap| (interpreter.findings(), trap))
}

/// The trap of a run, which is a finding; any other error is returned as an error.
fn trap_of(outcome: Result<()>) -> Result<Option<Error>> {
    match outcome {
        Ok(()) => Ok(None),
        Err(error) if error.kind() == anyhit_base::error::ErrorKind::Trap => Ok(Some(error)),
        Err(error) => Err(error),
    }
}
