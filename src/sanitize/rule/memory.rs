//! Rules about variables and memory.

rules! {
    UNINIT_FUNCTION "uninit-function" UndefinedValue
        "A local variable is read only where it has been written."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "give the variable a value where it is declared"
    UNINIT_PRIVATE "uninit-private" UndefinedValue
        "A global variable is read only where the invocation has written it."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "give the variable a value where it is declared"
    UNINIT_WORKGROUP "uninit-workgroup" UndefinedValue
        "A shared variable is read only where an invocation of the workgroup has written it."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "write all elements that are read, before a barrier(); mind those behind the number of invocations"
    UNINIT_BUFFER "uninit-buffer" UndefinedValue
        "Bytes of a buffer are read only where the scene or a shader has written them."
        "Vulkan, Memory Model, Allocation: the contents of new memory are undefined"
        "fill the buffer, as a host does: in the scene `data = { u32 = [0] }` beside `size` fills it with zeros; \
         or write it in an earlier pass"
    UNINIT_IMAGE "uninit-image" UndefinedValue
        "Texels of an image are read only where the scene or a shader has written them."
        "Vulkan, VK_IMAGE_LAYOUT_UNDEFINED: the contents of the memory are undefined"
        "clear the image, as a host does: in the scene `fill = 0`; or write it in an earlier pass; for \
         accumulation, do not read in the first frame"
    OUTPUT_UNWRITTEN "output-unwritten" Lint
        "A launch that writes an image of its size writes all of its texels."
        "the other texels keep what was in the memory before"
        "write the image on each path of the shader, or clear it before: `fill = 0` in the scene"
    DECLARED_ARRAY_BOUNDS "declared-array-bounds" Lint
        "Robust access or not: the index into an array in a buffer is less than its declared length."
        "the access is masked, although the buffer may have bytes there: values differ from driver to driver"
        "check the index against the length of the array"
    ROBUST_MASK "robust-mask" Lint
        "No access is outside its buffer or image, even where robust access masks it."
        "what is read there differs from driver to driver, and without robustness the behaviour is undefined"
        "check the index against the length of the buffer, or the coordinates against imageSize()"
    PTR_CHAIN_RANGE "ptr-chain-range" UndefinedBehavior
        "The element that a pointer is moved to lies in the same buffer, or one past its end."
        "SPIR-V 3.3.8, OpPtrAccessChain: the element must be one of the array that the base points into"
        "check the index against the number of elements before the pointer is made"
    ADDRESS_WRONG_BUFFER "address-wrong-buffer" Lint
        "Arithmetic on a device address does not lead into another buffer."
        "the bytes there are another object's, and where it lies is the driver's choice"
        "check the offset against the size of the buffer, and take the other buffer's own address"
    RUNTIME_ARRAY_LENGTH "runtime-array-length" Lint
        "The length of an array is not 0 where something is subtracted from it."
        "the difference wraps around, and what is limited to it is not"
        "handle the buffer without elements first, or compare `index + 1 < length`"
    ATOMIC_COUNTER_OVERFLOW "atomic-counter-overflow" Lint
        "A counter that gives out elements to write does not exceed how many there are."
        "whoever reads the counter as the number of elements reads behind the last one"
        "limit the counter where it is read, or make room for all elements"
    UNDEF_USE "undef-use" UndefinedValue
        "Nothing depends on the result of OpUndef."
        "SPIR-V 3.3.1, OpUndef: each use may see another value"
        "follow the value from where the shader makes it: a function without a return on some path, an out \
         parameter that is not written, or a shuffle without a source"
}
