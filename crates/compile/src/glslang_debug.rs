//! glslang with debug information: the one place of the crate that calls C, and the one that allows
//! `unsafe`.
//!
//! The safe binding offers no options for the SPIR-V that it generates, hence no `OpLine` and no
//! `NonSemantic.Shader.DebugInfo`. It does the includes and finds all mistakes; here its
//! preprocessed text is compiled again.

#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char};

use glslang::ShaderStage;
use glslang::limits::{DEFAULT_LIMITS, ResourceLimits};
use glslang_sys as sys;

use super::{DebugInfoLevel, Source};

/// glslang's name and version.
pub(super) fn version() -> String {
    let mut version = sys::glslang_version_t { major: 0, minor: 0, patch: 0, flavor: std::ptr::null() };
    // SAFETY: the function writes the four fields of the struct that it is given, and needs no
    // initialised process.
    unsafe { sys::glslang_get_version(&mut version) };
    format!("glslang {}.{}.{}", version.major, version.minor, version.patch)
}

/// Compiles preprocessed text to SPIR-V words; the error is glslang's log.
///
/// The caller has compiled the same text before, so `glslang::Compiler::acquire` has initialised
/// the process.
pub(super) fn compile(
    source: &Source,
    preprocessed: &str,
    stage: ShaderStage,
    debug: DebugInfoLevel,
) -> Result<Vec<u32>, String> {
    let c_string = |text: &str| CString::new(text).map_err(|_| "the text contains a NUL byte".to_owned());
    let code = c_string(preprocessed)?;
    let name = c_string(source.name())?;
    // Debuggers show the original text; the preprocessed text only gives the line numbers.
    let text = c_string(source.text())?;
    let limits: &ResourceLimits = &DEFAULT_LIMITS;
    // Not DEBUG_INFO: it would add the preprocessed text to the text as written.
    let messages = sys::glslang_messages_t::SPV_RULES | sys::glslang_messages_t::VULKAN_RULES;
    let input = sys::glslang_input_t {
        language: sys::glslang_source_t::GLSL,
        stage,
        client: sys::glslang_client_t::Vulkan,
        client_version: sys::glslang_target_client_version_t::Vulkan1_3,
        target_language: sys::glslang_target_language_t::SPIRV,
        target_language_version: sys::glslang_target_language_version_t::SPIRV1_6,
        code: code.as_ptr(),
        default_version: 100,
        default_profile: sys::glslang_profile_t::None,
        force_default_version_and_profile: 0,
        forward_compatible: 0,
        messages,
        // `ResourceLimits` is a `repr(transparent)` wrapper of the struct that is wanted here.
        resource: std::ptr::from_ref(limits).cast(),
        callbacks: sys::glsl_include_callbacks_t {
            include_system: None,
            include_local: None,
            free_include_result: None,
        },
        callbacks_ctx: std::ptr::null_mut(),
    };
    let full = debug == DebugInfoLevel::Full;
    let mut options = sys::glslang_spv_options_t {
        generate_debug_info: true,
        strip_debug_info: false,
        disable_optimizer: true,
        optimize_size: false,
        optimize_performance: false,
        disassemble: false,
        validate: false,
        emit_nonsemantic_shader_debug_info: full,
        emit_nonsemantic_shader_debug_source: full,
        compile_only: false,
        optimize_allow_expanded_id_bound: false,
        compiler_signature: std::ptr::null(),
        command_line_arguments: std::ptr::null(),
        current_working_directory: std::ptr::null(),
    };

    // SAFETY: `input` and all that it points to (`code`, the limits) live until the end of this
    // function, past every call that reads them. `Shader` and `Program` own what the two create
    // functions return, and are dropped in the order that glslang asks for: the program, declared
    // last, before its shader. The strings are zero-terminated, glslang copies name and source
    // text, and the length given is that of `text` without its end. The SPIR-V is copied into a
    // buffer of the size that glslang reports for it. The logs are read before their owners go.
    unsafe {
        let shader = Shader(sys::glslang_shader_create(&input));
        if shader.0.is_null() {
            return Err("glslang created no shader".into());
        }
        sys::glslang_shader_set_preprocessed_code(shader.0, code.as_ptr());
        if sys::glslang_shader_parse(shader.0, &input) == 0 {
            return Err(log(sys::glslang_shader_get_info_log(shader.0)));
        }
        let program = Program(sys::glslang_program_create());
        if program.0.is_null() {
            return Err("glslang created no program".into());
        }
        sys::glslang_program_add_shader(program.0, shader.0);
        if sys::glslang_program_link(program.0, messages.0) == 0 {
            return Err(log(sys::glslang_program_get_info_log(program.0)));
        }
        sys::glslang_program_set_source_file(program.0, stage, name.as_ptr());
        sys::glslang_program_add_source_text(program.0, stage, text.as_ptr(), source.text().len());
        sys::glslang_program_SPIRV_generate_with_options(program.0, stage, &mut options);
        let mut words = vec![0; sys::glslang_program_SPIRV_get_size(program.0)];
        sys::glslang_program_SPIRV_get(program.0, words.as_mut_ptr());
        Ok(words)
    }
}

struct Shader(*mut sys::glslang_shader_t);

impl Drop for Shader {
    fn drop(&mut self) {
        // SAFETY: the pointer comes from `glslang_shader_create`, is owned here alone, and the
        // function accepts null.
        unsafe { sys::glslang_shader_delete(self.0) }
    }
}

struct Program(*mut sys::glslang_program_t);

impl Drop for Program {
    fn drop(&mut self) {
        if !self.0.is_null() {
            // SAFETY: the pointer comes from `glslang_program_create`, is not null, and is owned
            // here alone.
            unsafe { sys::glslang_program_delete(self.0) }
        }
    }
}

/// Copies a log of glslang.
///
/// # Safety
/// `text` is null or points to a zero-terminated string that does not change meanwhile.
unsafe fn log(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: as the caller promises.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}
