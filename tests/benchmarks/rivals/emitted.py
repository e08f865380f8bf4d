"""ncgen's own code in other ways than `ncgen compare` has: every emission and number type, batches, without checks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ncgen.comparisons.rivals.base import Inputs, Rival, called
from ncgen.comparisons.rivals.generated import emitted
from ncgen.compiler import generate
from ncgen.emit.naming import prefix_of
from ncgen.emit.sources import Sources
from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.library import CompiledKernels
from ncgen.model import Model
from ncgen.program.programs import EMISSIONS
from ncgen.report.clock import Run, repeated
from ncgen.report.repeat import timing
from ncgen.toolchain.abi import NUMBERS, abi, marked
from ncgen.toolchain.compilers import FLAGS
from ncgen.toolchain.loader import load

STATES = 1000
"""States of a batch: few enough to stay in the processor's second cache."""


def emissions(model: Model, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """The emissions that are chosen by name."""
    return [emitted(model, inputs, names, emission) for emission in sorted(set(EMISSIONS) - {"auto"})]


def other_types(model: Model, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """The same source for float and long double."""
    sources = generate(model)
    tools = []
    for name in (name for name in NUMBERS if name != "double"):
        runs, out = typed_runner(sources, name, inputs.t, inputs.q, inputs.qd, inputs.p, names)
        epsilon = float(np.finfo(NUMBERS[name].dtype).eps)
        tools.append(
            Rival(
                name=f"generated C, {name}", runs=runs, values=lambda k, runs=runs, out=out: (runs[k](1), out[k].copy())[1], epsilon=epsilon
            )
        )
    return tools


def direct(kernels: CompiledKernels, inputs: Inputs, names: Sequence[str]) -> Rival:
    """Kernels on arrays of their own, for loops in Python."""
    functions = {k: kernels.direct(k) for k in names if k in kernels.programs.programs}
    for function in functions.values():
        function.q[:], function.qd[:], function.p[:], function.t = inputs.q, inputs.qd, inputs.p, inputs.t
    return called("generated C, direct", functions, lambda k: (functions[k](), functions[k].out.copy())[1])


def batch(kernels: CompiledKernels, inputs: Inputs, names: Sequence[str]) -> Rival:
    """Many states in one call, each the same; times are those of a state."""
    q, qd = (np.tile(x, (STATES, 1)) for x in (inputs.q, inputs.qd))
    out = {k: np.empty((STATES, kernels.programs.programs[k].size)) for k in names}

    def function(k: str) -> Callable[[], np.ndarray]:
        return lambda: kernels.batch.values(k, inputs.t, q, qd, inputs.p, out[k])

    runs = {k: repeated(function(k)) for k in names}
    return Rival(name=f"generated C, batch of {STATES}", runs=runs, values=lambda k: function(k)()[0], language="Python", calls=STATES)


def typed_runner(
    sources: Sources, real: str, t: float, q: np.ndarray, v: np.ndarray, p: np.ndarray, names: Sequence[str]
) -> tuple[dict[str, Run], dict[str, np.ndarray]]:
    """({kernel: run(times)}, {kernel: its output}) of a model's source compiled for another number type, and for all at once.

    sources: as `ncgen.generate` gives them; t, q, v, p: in double
    """
    number = NUMBERS[real]
    getter = f"{prefix_of(sources.programs.equations.model.name)}_model"
    declarations = marked(timing(), "functions") + f"const ncgen_model *{getter}(void);"
    ffi, library = load(sources.c | {"timing.c": timing()}, declarations, abi(real), (*FLAGS, *number.flags))
    model = getattr(library, getter)()
    arrays = [np.array(x, dtype=number.dtype) for x in (q, v, p)]
    programs = sources.programs.programs
    out = {name: np.empty(programs[name].size, dtype=number.dtype) for name in names}

    def run(name: str) -> Run:
        empty = [ffi.NULL] * 4
        call = [getattr(model, name), pointer(ffi, out[name], "ncgen_real[]")]
        calls = [*empty, *call] if "qd" in programs[name].inputs else [*call, *empty]
        state = [pointer(ffi, x, "ncgen_real[]") for x in arrays]

        def turns(times: int, keep: object = (arrays, library)) -> None:
            library.ncgen_repeat(times, t, *state, *calls)

        return turns

    return {name: run(name) for name in names}, out
