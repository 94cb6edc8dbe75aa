//! The debugger, by the number of turns that it runs through.

use rspirv::spirv::{ExecutionModel, Op};

use anyhit_debugger::debugger::{Debugger, StopReason};
use anyhit_debugger::session::{ExplainRequest, Session};
use anyhit_scene::{DiskFiles, LoadOptions, load};

use crate::curve::Curve;
use crate::measure::Work;
use crate::module_writer::Writer;
use crate::scene_text::{compute_scene, write};

/// The curves of the debugger.
pub fn curves() -> Vec<Curve> {
    let sizes = [1 << 12, 1 << 14, 1 << 16, 1 << 18];
    vec![Curve::linear("debugger: continue through turns of a loop", sizes, |folder, n| {
        write(folder, "main.spv", sum());
        let words = format!(
            "[resources.words]\ntype = \"storage_buffer\"\nbinding = 1\ndata = {{ u32 = [{n}, 0] }}\n"
        );
        write(folder, "scene.toml", compute_scene(1, &words));
        let path = folder.join("scene.toml");
        Work::call(move || {
            let scene = load(&path, &DiskFiles, &LoadOptions::default()).expect("a scene");
            let session = Session::new(scene).expect("valid shaders");
            let request = ExplainRequest::Invocation { dispatch: 0, id: [0; 3] };
            let mut debugger = Debugger::of_scene(&session, &request).expect("such an invocation");
            debugger.begin();
            let stop = debugger.resume();
            assert!(matches!(stop, StopReason::End), "{stop:?}");
        })
    })]
}

/// Adds the numbers below word 0 of the buffer.
fn sum() -> Vec<u8> {
    let mut it = Writer::new(ExecutionModel::GLCompute);
    let (uint, zero, one) = (it.uint, it.constant(0), it.constant(1));
    let count = it.load_word(zero);
    let sum = it.local(uint);
    it.op(Op::Store, &[sum, zero]);
    it.repeat(count, |it, turn| {
        let value = it.result(Op::Load, uint, &[sum]);
        let value = it.result(Op::IAdd, uint, &[value, turn]);
        it.op(Op::Store, &[sum, value]);
    });
    let value = it.result(Op::Load, uint, &[sum]);
    it.store_word(one, value);
    it.finish()
}
