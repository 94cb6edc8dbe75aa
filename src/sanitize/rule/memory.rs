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
    UNDEF_USE "undef-use" UndefinedValue
        "Nothing depends on the result of OpUndef."
        "SPIR-V 3.3.1, OpUndef: each use may see another value"
        "follow the value from where the shader makes it: a function without a return on some path, an out \
         parameter that is not written, or a shuffle without a source"
}
