"""WebAssembly: the bytes of a module, written from programs without a compiler.

    binary    the format: numbers, vectors, sections
    memory    where arrays and tables lie
    code      operations, loops and stores as instructions
    sincos    sine and cosine as C computes them
    files     a mechanism's kernels as one module

A kernel takes the time as a number and addresses of q, qd, p and of its result in the module's memory, of which `ncgen_heap` is the first
free address. Elementary functions are imported from "Math", whose functions have the same names.
"""
