"""WebAssembly: the bytes of a module, written from programs without a compiler, that is linked to the runtime where it runs.

    binary    the format: numbers, vectors, sections
    memory    where arrays and tables lie
    code      operations, loops and stores as instructions
    linked    a mechanism's kernels as one module

A kernel takes the time as a number and addresses of q, qd, p and of its result in the memory of the runtime. Elementary functions are
imported from "Math", whose functions have the same names; sines and cosines of angles, and lookups, are the runtime's.
"""
