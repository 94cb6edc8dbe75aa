//! A trap as data: which rule a shader broke while it ran, where, with what values, and the shaders
//! that called it.

use serde::{Deserialize, Serialize, Serializer};

use crate::error::{Stage, TrapCode};

/// A trap that ended a run: what [`Error::trap`](crate::error::Error::trap) has where its text is
/// [`Error::render`](crate::error::Error::render).
///
/// In JSON it is an object with `code`, `stage`, `entry_point`, `launch_id`, `file`, `line`,
/// `column`, `word`, `fault_value`, `operands`, `stack` and `vuid`; what is not known is `null`.
///
/// ```
/// use anyhit::{LoadedScene, Stage, TrapCode, TrapOperands};
///
/// # fn main() -> anyhit::Result<()> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
/// let mut scene = LoadedScene::open("shaders/pass/frames/ping-pong/scene.toml")?;
/// let error = scene.set_max_recursion(0)?.launch().unwrap_err();
/// let trap = error.trap().unwrap();
/// assert_eq!(trap.code, TrapCode::RecursionTooDeep);
/// assert_eq!((trap.stage(), trap.launch_id), (Some(Stage::RayGeneration), [0, 0, 0]));
/// let TrapOperands::Limit { key, value, .. } = trap.operands else { panic!("{trap:?}") };
/// assert_eq!((key, value), ("max_recursion_depth", 0.0));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Trap {
    /// The rule that was broken, or the limit that was passed.
    pub code: TrapCode,
    /// `LaunchIdKHR` of the invocation, in compute shaders `GlobalInvocationId`; 0 for a ray that
    /// the host traces. Of [`TrapCode::LaunchOutOfFuel`] it may be the last of the invocations that
    /// spent the fuel together.
    pub launch_id: [u32; 3],
    /// The value that caused it, 0 where there is none: the byte offset or device address of an
    /// access, the index of a record, the number of a shader whose payload does not match.
    /// [`Trap::operands`] tells the values by name.
    pub fault_value: u64,
    /// The values that caused it.
    pub operands: TrapOperands,
    /// The stack of shader calls, innermost first: the shader that trapped, the shader that called
    /// it by a trace or a call, and so on. It is empty where no shader runs: at a ray that the host
    /// traces, and where invocations have spent their fuel together.
    pub stack: Vec<ShaderFrame>,
    /// The valid-usage rule of Vulkan that was broken, where the report cites one:
    /// `VUID-RuntimeSpirv-OpTraceRayKHR-06355`.
    pub vuid: Option<String>,
}

impl Trap {
    /// A trap of which nothing but the code is known.
    #[doc(hidden)]
    pub fn new(code: TrapCode) -> Self {
        Self {
            code,
            launch_id: [0; 3],
            fault_value: 0,
            operands: TrapOperands::None,
            stack: Vec::new(),
            vuid: code.vuid().map(str::to_owned),
        }
    }

    /// The shader that trapped, the innermost of [`Trap::stack`].
    #[must_use]
    pub fn frame(&self) -> Option<&ShaderFrame> {
        self.stack.first()
    }

    /// The stage of the shader that trapped.
    #[must_use]
    pub fn stage(&self) -> Option<Stage> {
        Some(self.frame()?.stage)
    }

    /// The entry point of the shader that trapped.
    #[must_use]
    pub fn entry_point(&self) -> Option<&str> {
        Some(&self.frame()?.entry_point)
    }

    /// The source file of the instruction that trapped, as the debug information names it.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        self.frame()?.file.as_deref()
    }

    /// The source line of the instruction that trapped, from 1.
    #[must_use]
    pub fn line(&self) -> Option<u32> {
        self.frame()?.line
    }

    /// The column of the instruction that trapped, from 1.
    #[must_use]
    pub fn column(&self) -> Option<u32> {
        self.frame()?.column
    }
}

/// A shader on the stack of shader calls, and where in it the run stands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShaderFrame {
    /// The index of the shader in its pipeline; 0 for a shader without one, such as a compute
    /// shader.
    pub shader: u32,
    /// The stage.
    pub stage: Stage,
    /// The name of the entry point.
    pub entry_point: String,
    /// The source file, as the debug information names it; `None` without debug information.
    pub file: Option<String>,
    /// The source line, from 1. Of an instruction without a line of its own (`OpNoLine`) it is the
    /// last line before it.
    pub line: Option<u32>,
    /// The column, from 1, where the compiler tells it.
    pub column: Option<u32>,
    /// The instruction, in words from the start of the shader's module.
    pub word: Option<u32>,
}

/// The values that caused a trap.
///
/// In JSON `kind` holds the name of the variant in snake case, beside the fields.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum TrapOperands {
    /// The code tells all that is known.
    None,
    /// An index outside its array, vector or matrix.
    Index {
        /// The index; `None` beyond 32 bits.
        index: Option<i64>,
        /// How many elements, components or columns there are; `None` where the shader does not
        /// say it, as of a runtime array of descriptors.
        length: Option<u64>,
        /// The source expression of what is indexed, such as `block.registers[2]`; `None` where it
        /// has no name.
        of: Option<String>,
    },
    /// Bytes of a buffer.
    Buffer {
        /// Where the buffer is bound; `None` for one that is bound nowhere.
        descriptor: Option<DescriptorElement>,
        /// `PushConstant`, `ShaderRecordBufferKHR` or `Workgroup`, where the memory is of that
        /// storage class and not a buffer that is bound.
        storage_class: Option<&'static str>,
        /// The offset of the access, in bytes.
        offset: u64,
        /// The size of the access, in bytes.
        bytes: u32,
        /// The size of the buffer, or of the range that is bound, in bytes; `None` where it is not
        /// known.
        size: Option<u64>,
        /// The index into a runtime array that led beyond the end of the buffer, if one did.
        index: Option<i64>,
        /// How many elements of that array the buffer holds.
        length: Option<u64>,
        /// The source expression of that array.
        of: Option<String>,
    },
    /// A device address.
    Address {
        /// The address.
        address: u64,
        /// The size of the access, in bytes; `None` for an acceleration structure.
        bytes: Option<u32>,
        /// The address of the first byte of the nearest buffer; `None` where no buffer has an
        /// address, and for a null pointer.
        start: Option<u64>,
        /// The size of that buffer, in bytes.
        size: Option<u64>,
        /// The scene's name for that buffer.
        buffer: Option<String>,
        /// Where that buffer is bound, too, if it is.
        descriptor: Option<DescriptorElement>,
    },
    /// A texel of an image.
    Texel {
        /// Where the image is bound.
        image: Option<DescriptorElement>,
        /// Column, row and slice, then the layer of an array or cube.
        coordinate: Vec<i64>,
        /// Columns, rows and slices of the level, then the layers.
        extent: Vec<u32>,
        /// The level.
        level: u32,
        /// How many levels the image has.
        levels: u32,
        /// The sample.
        sample: u32,
        /// How many samples a texel has.
        samples: u32,
    },
    /// A descriptor that is not bound, or of another kind than the access needs.
    Descriptor {
        /// The descriptor; `None` for a null descriptor.
        descriptor: Option<DescriptorElement>,
    },
    /// An offset in a descriptor heap where no descriptor lies.
    HeapOffset {
        /// `the resource heap` or `the sampler heap`.
        heap: String,
        /// Bytes from the beginning of the heap.
        offset: u64,
    },
    /// A record of a shader binding table.
    Record {
        /// The key of the table in scenes: `hit`, `miss` or `callable`.
        table: &'static str,
        /// The index of the record, from 0.
        index: u64,
        /// How many records the table has.
        records: u64,
    },
    /// Operands of a ray.
    Ray {
        /// What is wrong with them.
        rule: &'static str,
    },
    /// Message of `OpAbortKHR`.
    Abort {
        /// The formatted message. Text before the first number is a format of `debugPrintfEXT` for
        /// the values that follow; values without a directive are appended.
        message: String,
    },
    /// The hit kind of a report.
    HitKind {
        /// The hit kind; 127 is the greatest that a shader may report.
        hit_kind: u32,
    },
    /// A shader that takes a payload, or callable data, of another type than it is given.
    Callee {
        /// The index of the shader in its pipeline.
        shader: u32,
        /// Its stage.
        stage: Stage,
        /// The name of its entry point.
        entry_point: String,
    },
    /// A limit of running.
    Limit {
        /// The key of the limit in scenes: `fuel`, `launch_fuel`, `timeout`, `batch_timeout`,
        /// `max_recursion_depth`, `max_callable_depth` or `max_stack_size`.
        key: &'static str,
        /// The limit, in the unit of its key: instructions, seconds, shaders or bytes.
        value: f64,
    },
}

/// An index outside its array, vector or matrix; see [`TrapOperands::Index`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IndexOperand {
    /// The index, if it is known.
    pub index: Option<i64>,
    /// The number of elements, if it is known.
    pub length: Option<u64>,
    /// The name of the array, vector or matrix.
    pub of: Option<String>,
    /// Of an element of a runtime array in a buffer: its offset there, in bytes.
    pub offset: Option<u64>,
}

/// An element of a descriptor binding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DescriptorElement {
    /// The name of the variable in the shader, empty where it has none.
    pub name: String,
    /// The descriptor set; 4,294,967,294 for a heap (`SPV_EXT_descriptor_heap`).
    pub set: u32,
    /// The binding; of a heap 0 for that of the resources, 1 for that of the samplers.
    pub binding: u32,
    /// The element of an array of descriptors, 0 for a single one.
    pub element: u32,
}

/// The fields of a trap in JSON, with those of the innermost frame beside them.
#[derive(Serialize)]
struct TrapFields<'a> {
    code: &'static str,
    stage: Option<Stage>,
    entry_point: Option<&'a str>,
    launch_id: [u32; 3],
    file: Option<&'a str>,
    line: Option<u32>,
    column: Option<u32>,
    word: Option<u32>,
    fault_value: u64,
    operands: Option<&'a TrapOperands>,
    stack: &'a [ShaderFrame],
    vuid: Option<&'a str>,
}

impl Serialize for Trap {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let fields = TrapFields {
            code: self.code.name(),
            stage: self.stage(),
            entry_point: self.entry_point(),
            launch_id: self.launch_id,
            file: self.file(),
            line: self.line(),
            column: self.column(),
            word: self.frame().and_then(|frame| frame.word),
            fault_value: self.fault_value,
            operands: Some(&self.operands).filter(|operands| **operands != TrapOperands::None),
            stack: &self.stack,
            vuid: self.vuid.as_deref(),
        };
        fields.serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use pretty_assertions::assert_eq;
    use serde_json::json;

    use super::*;

    #[test]
    fn a_trap_is_one_object_in_json() {
        let frame = |stage, line| ShaderFrame {
            shader: 1,
            stage,
            entry_point: "main".into(),
            file: Some("a.rchit".into()),
            line: Some(line),
            column: None,
            word: Some(70),
        };
        let trap = Trap {
            launch_id: [3, 2, 0],
            operands: TrapOperands::Index { index: Some(-1), length: Some(4), of: Some("table".into()) },
            stack: vec![frame(Stage::ClosestHit, 12), frame(Stage::RayGeneration, 7)],
            ..Trap::new(TrapCode::IndexOutOfBounds)
        };
        let frame = |stage, line| {
            json!({
                "shader": 1, "stage": stage, "entry_point": "main", "file": "a.rchit", "line": line,
                "column": null, "word": 70
            })
        };
        assert_eq!(
            serde_json::to_value(&trap).unwrap(),
            json!({
                "code": "index_out_of_bounds", "stage": "ClosestHitKHR", "entry_point": "main",
                "launch_id": [3, 2, 0], "file": "a.rchit", "line": 12, "column": null, "word": 70,
                "fault_value": 0,
                "operands": { "kind": "index", "index": -1, "length": 4, "of": "table" },
                "stack": [frame("ClosestHitKHR", 12), frame("RayGenerationKHR", 7)],
                "vuid": null
            })
        );
        let bare = serde_json::to_value(Trap::new(TrapCode::NullMiss)).unwrap();
        assert_eq!(bare["vuid"], "VUID-vkCmdTraceRaysKHR-flags-03511");
        assert_eq!((&bare["operands"], &bare["stage"]), (&json!(null), &json!(null)));
    }

    #[test]
    fn a_trap_passes_between_threads() {
        fn is_shared<T: Send + Sync + Clone + std::fmt::Debug>() {}
        is_shared::<Trap>();
    }
}
