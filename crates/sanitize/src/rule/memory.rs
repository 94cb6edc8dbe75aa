//! Rules about variables and memory.

rules! {
    UNINIT_FUNCTION "uninit-function" UndefinedValue
        "A local variable is written before it is read."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "initialize the variable where it is declared"
    UNINIT_PRIVATE "uninit-private" UndefinedValue
        "A global variable is written by the invocation before it is read."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "initialize the variable where it is declared"
    UNINIT_WORKGROUP "uninit-workgroup" UndefinedValue
        "A shared variable is written by an invocation of the workgroup before it is read."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "before a barrier(), write all elements that are read, including those beyond the number of \
         invocations"
    UNINIT_BUFFER "uninit-buffer" UndefinedValue
        "Bytes of a buffer are written by the scene or a shader before they are read."
        "Vulkan, Memory Model, Allocation: the contents of new memory are undefined"
        "fill the buffer, as a host does (`data = { u32 = [0] }` with `size` in the scene fills it with \
         zeros), or write it in an earlier pass"
    UNINIT_IMAGE "uninit-image" UndefinedValue
        "Texels of an image are written by the scene or a shader before they are read."
        "Vulkan, VK_IMAGE_LAYOUT_UNDEFINED: the contents of the memory are undefined"
        "clear the image, as a host does (`fill = 0` in the scene), or write it in an earlier pass; for \
         accumulation, do not read it in the first frame"
    OUTPUT_UNWRITTEN "output-unwritten" Lint
        "A launch that writes an image of the launch size writes all of its texels."
        "the other texels keep the previous contents of the memory"
        "write the image on every path of the shader, or clear it first (`fill = 0` in the scene)"
    DECLARED_ARRAY_BOUNDS "declared-array-bounds" Lint
        "The index into an array in a buffer is less than its declared length, with or without robust access."
        "the access is masked although the buffer may contain these bytes: values depend on the driver"
        "check the index against the length of the array"
    ROBUST_MASK "robust-mask" Lint
        "No access is outside its buffer or image, even if robust access masks it."
        "the value that is read depends on the driver, and without robustness the behaviour is undefined"
        "check the index against the length of the buffer, or the coordinates against imageSize()"
    PTR_CHAIN_RANGE "ptr-chain-range" UndefinedBehavior
        "A pointer moves only to elements of the same buffer, or to one past its end."
        "SPIR-V 3.3.8, OpPtrAccessChain: the element must be one of the array that the base points into"
        "check the index against the number of elements before computing the pointer"
    ADDRESS_WRONG_BUFFER "address-wrong-buffer" Lint
        "Arithmetic on a device address does not lead into another buffer."
        "the bytes belong to another object, whose address the driver chooses"
        "check the offset against the size of the buffer, and use the other buffer's own address"
    RUNTIME_ARRAY_LENGTH "runtime-array-length" Lint
        "The length of a runtime array is not 0 if a value is subtracted from it."
        "the difference wraps around, and as an upper bound it limits nothing"
        "handle the empty buffer first, or compare `index + 1 < length`"
    ATOMIC_COUNTER_OVERFLOW "atomic-counter-overflow" Lint
        "A counter that allocates elements to write does not exceed the number of elements."
        "code that reads the counter as the number of elements reads past the last one"
        "clamp the counter where it is read, or make room for all elements"
    UNDEF_USE "undef-use" UndefinedValue
        "Nothing depends on the result of OpUndef."
        "SPIR-V 3.3.1, OpUndef: each use may have a different value"
        "look for the cause in the shader: a function without a return on some path, an out parameter that \
         is not written, or a shuffle without a source"
}
