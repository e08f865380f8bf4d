"""What every export starts from: a mechanism's sources, its independent coordinates, where it starts, and what it costs.

All names of C that ncgen gives away begin with the model's: `ncgen_simulate` becomes `robot_ncgen_simulate`, NCGEN_OK becomes
ROBOT_NCGEN_OK, ncgen.h becomes robot_ncgen.h. So two exported mechanisms live in one program, or in one file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ncgen import __version__
from ncgen.compiler import compile, generate
from ncgen.emit.c.files import program_records
from ncgen.emit.c.spelling import number
from ncgen.emit.environment import render
from ncgen.emit.naming import identifier
from ncgen.emit.runtime import HEADERS, runtime_files
from ncgen.emit.sources import Sources
from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.program.blocks import Program
from ncgen.program.cost import cost
from ncgen.program.full_loads import assemble_loads
from ncgen.program.full_motion import FullMotion, Sizes, assemble_full_motion, assemble_full_tangents
from ncgen.solver.rank import freedom, trial_positions
from ncgen.solver.run import Run, check_options, simulation_of
from ncgen.solver.start import begin

PUBLIC = ("ncgen.h",)
"""Headers of ncgen that an embedder reads; the others stay beside the sources."""

NEWTON_STEPS = 4
"""Newton steps by which a step of fixed length may close the loops at its end."""


@dataclass(frozen=True, eq=False)
class Package:
    """A mechanism ready to be written for a target.

    q, qd: where it starts, consistent; duration: s; dof: degrees of freedom
    tangents, loads: of the programs, and joint loads with their tangent, where a target has them
    """

    sources: Sources
    kernels: Kernels
    programs: FullMotion
    sizes: Sizes
    q: np.ndarray
    qd: np.ndarray
    duration: float
    dof: int
    tangents: FullMotion | None = None
    loads: tuple[Program, ...] = ()

    def with_tangents(self) -> Package:
        """The same with the tangents of its motion, and with joint loads."""
        equations = self.sources.programs.equations
        tangents = assemble_full_tangents(equations, self.sizes, self.kernels.holonomic)
        return replace(self, tangents=tangents, loads=assemble_loads(equations))

    @property
    def prefix(self) -> str:
        return identifier(self.kernels.name)

    @cached_property
    def c(self) -> dict[str, str]:
        """{file name: text}: everything in C, with names of its own."""
        files = self.sources.c | runtime_files(*HEADERS)
        records = self.records | {name: [number(x) for x in self.records[name]] for name in ("start", "speeds", "row_sizes")}
        files |= {f"{self.prefix}_motion.{kind}": render(f"package/motion.{kind}.jinja", **records) for kind in "hc"}
        return {renamed(name, self.prefix): renamed(text, self.prefix) for name, text in files.items()}

    @property
    def public(self) -> tuple[str, ...]:
        """Names of the headers an embedder includes."""
        own = (f"{self.prefix}.h", f"{self.prefix}_motion.h")
        return (*own, *(renamed(name, self.prefix) for name in PUBLIC))

    @cached_property
    def records(self) -> dict:
        """What the templates of all targets are filled with."""
        programs = self.sources.programs
        operations = {name: cost(program).total for name, program in programs.programs.items()}
        closing, motion = (cost(program).total for program in (self.programs.closing, self.programs.motion))
        return {
            "version": __version__,
            "model": self.kernels.model,
            "coordinates": self.kernels.coordinates,
            "units": [self.unit(name) for name in self.kernels.coordinates],
            "rows": self.kernels.rows,
            "parameters": programs.equations.parameters,
            "defaults": [float(value) for value in self.kernels.p0],
            "dof": self.dof,
            "start": self.q.tolist(),
            "speeds": self.qd.tolist(),
            "row_sizes": self.kernels.row_sizes.tolist(),
            "duration": self.duration,
            "operations": operations,
            "newton_steps": NEWTON_STEPS,
            "closing": closing,
            "motion": motion,
            "step": 5 * motion + NEWTON_STEPS * closing,
            "numbers": 4 + 3 * self.kernels.n + self.kernels.m,
            "kernel_shapes": [
                {"name": name, "inputs": program.inputs, "size": program.size} for name, program in programs.programs.items()
            ],
            "tangents": self.tangents is not None,
            **program_records(self._motion_programs(), self.prefix, "motion"),
        }

    def _motion_programs(self) -> list[Program]:
        pairs = [pair for pair in (self.programs, self.tangents) if pair]
        return [*(program for pair in pairs for program in (pair.closing, pair.motion)), *self.loads]

    def unit(self, coordinate: str) -> str:
        """Unit of a free coordinate: m, rad, or 1 for a component of a unit vector."""
        return next(e.unit for e in self.kernels.model.elements.values() if any(c.name == coordinate for c in e.components))


def package(model: Model) -> Package:
    """Generate a mechanism and its motion. Raises ModelError where its motion has no export."""
    if reason := _refusal(model):
        raise ModelError(f"{model.name} cannot be exported: {reason}")
    sources = generate(model)
    kernels = compile(sources, backend="numpy")
    run = _simulation(kernels)
    start = begin(kernels, run.initial, partitioned=True)
    positions = trial_positions(kernels, start.q, 0.0, None)
    sizes = Sizes(kernels.column_sizes, *(tuple(map(f, positions)) for f in (kernels.jacobian, kernels.mass_matrix)))
    if not np.any(sizes.W):
        raise ModelError(f"{model.name} cannot be exported: nothing has mass; give a body one")
    programs = assemble_full_motion(sources.programs.equations, sizes, kernels.holonomic)
    return Package(sources, kernels, programs, sizes, start.q, start.qd, run.duration, freedom(kernels).dof)


def _simulation(kernels: Kernels) -> Run:
    """The run that the model describes. Raises ModelError where it cannot be asked for, or begins as no export does."""
    options = simulation_of(kernels.model)
    check_options(options)
    run, refused = Run.asked(kernels, **options), f"{kernels.name} cannot be exported: its simulation"
    if run.initial.t != 0:
        raise ModelError(f"{refused} begins at t0 = {run.initial.t:.6g} s, an export at 0; describe the motion from 0 on")
    for name, value, default in zip(kernels.parameters, run.initial.p, kernels.p0, strict=True):
        if value != default:
            raise ModelError(f"{refused} has p of its own: {name} = {value:.6g}; make that the parameter's default")
    return run


def _refusal(model: Model) -> str | None:
    if model.callbacks:
        return "it calls a Python function"
    if model.branches:
        return "the paper's sine-or-cosine rows choose anew between steps; use smooth angles"
    return None


def renamed(text: str, prefix: str) -> str:
    """Names of C and of files that begin like ncgen's, with the model's name before them."""
    text = re.sub(r"\bncgen(?=_\w|\.[hc]\b)", f"{prefix}_ncgen", text)
    return re.sub(r"\bNCGEN_(?=\w)", f"{prefix.upper()}_NCGEN_", text)
