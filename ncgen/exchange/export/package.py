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
from ncgen.emit.c.c_spelling import number
from ncgen.emit.c.files import program_records
from ncgen.emit.environment import render
from ncgen.emit.naming import labels, prefix_of
from ncgen.emit.runtime_files import HEADERS, WITHOUT_TABLES, constant_of, needed_by, row_vectors, runtime_files, widest_tableau
from ncgen.emit.sources import Sources
from ncgen.errors import ModelError, shortened
from ncgen.exchange.export.switches import Switching, assemble_switches
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.motion_sources import motion_source
from ncgen.mechanism.properties import is_conservative, is_definite
from ncgen.model import Model
from ncgen.model.actions import Change, Impact, Locking, Stop
from ncgen.program.algebra.quasidefinite import Elimination, plan
from ncgen.program.ir.blocks import Pattern, Program
from ncgen.program.ir.cost import cost
from ncgen.program.motions.full_loads import assemble_loads
from ncgen.program.motions.full_motion import FullMotion, MotionSizes, assemble_full_motion, assemble_full_tangents
from ncgen.program.motions.output_programs import assemble_outputs
from ncgen.solver.argument_checks import has_events, names_of_events
from ncgen.solver.engines.acceleration_forms import own_positions
from ncgen.solver.events.event_table import EventTable
from ncgen.solver.events.held_mechanism import HeldMechanism, refusal_of_frictions, refusal_of_loads, refusal_of_shared, with_switches
from ncgen.solver.loads.observed_loads import instant, warn_of_shared
from ncgen.solver.name_lists import listed_names
from ncgen.solver.positions.partition import determined
from ncgen.solver.positions.rank import freedom, trial_positions
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.simulation_options import check_options, simulation_of
from ncgen.solver.runs.start import begin
from ncgen.solver.trajectories.output_values import uses_loads

PUBLIC = ("ncgen.h",)
"""Headers of ncgen that an embedder reads; the others stay beside the sources."""

RUNTIME = "ncgen_driven.c"
"""The file of the runtime that exports in C move by; what it needs comes along."""


BREAKS = "ncgen_breaks.c"
"""Likewise of those whose laws of time change their formula."""

EVENTS = "ncgen_events.c"
"""Likewise of those that have events."""

CLOSING = "ncgen_closing_tangent.c"
"""Likewise of those with derivatives."""

FORMULAS = "ncgen_formula.c"
"""Likewise of those with conditions that are no polynomials within a step."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Package:
    """A mechanism ready to be written for a target.

    q, qd: where it starts, consistent; independent: coordinates whose velocities can be chosen there; duration: s; dof: degrees of freedom
    full: the programs that find all at once, where a target has no runtime of ncgen's, or needs derivatives; tangents, loads: of these
        programs, and joint loads with their tangent
    """

    sources: Sources
    kernels: Kernels
    sizes: MotionSizes
    q: np.ndarray
    qd: np.ndarray
    independent: tuple[str, ...]
    duration: float
    dof: int
    tangents: FullMotion | None = None
    loads: tuple[Program, ...] = ()

    @cached_property
    def full(self) -> FullMotion:
        return assemble_full_motion(self.sources.programs.equations, self.sizes, self.kernels.holonomic)

    def with_tangents(self) -> Package:
        """The same with the tangents of its motion, and with joint loads."""
        equations = self.sources.programs.equations
        tangents = assemble_full_tangents(equations, self.sizes, self.kernels.holonomic)
        loads = () if self.held else assemble_loads(equations)  # of joints alone they are not known where something is held
        return replace(self, tangents=tangents, loads=loads)

    @property
    def prefix(self) -> str:
        return prefix_of(self.kernels.name)

    @cached_property
    def c(self) -> dict[str, str]:
        """{file name: text}: everything in C, with names of its own."""
        more = [*([BREAKS] if self.switching else []), *([EVENTS] if self.events else [])]
        more += [FORMULAS] if self.events and self.events.described["formulas"] else []
        more += [CLOSING] if self.tangents else []
        needed = needed_by(RUNTIME, *more, defined=(WITHOUT_TABLES,))
        runtime = runtime_files(*HEADERS, *needed, defined=(WITHOUT_TABLES,))
        files = self.sources.c | self.recursion | runtime
        if self.held:
            files |= self.held.sources.c
        records = self.records | self._described | self._described_held
        files |= {f"{self.prefix}_motion.{kind}": render(f"package/motion.{kind}.jinja", **records) for kind in "hc"}
        return {renamed(name, self.prefix): renamed(text, self.prefix) for name, text in files.items()}

    @cached_property
    def recursion(self) -> dict[str, str]:
        """{file name: text} of the accelerations over the tree of bodies; {} where the matrix of the equations gives them."""
        return motion_source(self.kernels, lambda: own_positions(self.kernels))

    @cached_property
    def rank(self) -> int:
        """Of the Jacobian at the start."""
        return freedom(self.kernels, self.q).rank

    @cached_property
    def singular_mass(self) -> bool:
        """Whether some motion has no inertia."""
        return not is_definite(self.kernels)

    @cached_property
    def conservative(self) -> bool:
        """Whether there is no work to integrate."""
        return is_conservative(self.kernels)

    def elimination(self, phi_q: Pattern) -> Elimination:
        """In which the matrix of the equations is eliminated, with a Jacobian of this pattern."""
        return plan(self.kernels.mass_pattern, phi_q)

    @cached_property
    def _order(self) -> Elimination:
        return self.elimination(self.kernels.phi_q_pattern)

    @property
    def _described(self) -> dict[str, object]:
        """What the runtime gets of the mechanism."""
        kernels, order = self.kernels, self._order
        arrays = {"start": self.q, "speeds": self.qd, "row_sizes": kernels.row_sizes, "column_sizes": kernels.column_sizes}
        return {
            **{name: [number(float(x)) for x in values] for name, values in arrays.items()},
            "elimination": {"size": order.size, "nonzeros": order.nonzeros, "tables": [(a, getattr(order, a)) for a in Elimination.ARRAYS]},
            "nonzeros": kernels.mass_pattern.nonzeros + kernels.phi_q_pattern.nonzeros,
            "rank": self.rank,
            "redundant": self.rank < kernels.m,
            "vectors": row_vectors(kernels.m, self.rank),
            "singular_mass": self.singular_mass,
            "conservative": self.conservative,
            "widest": widest_tableau(),
        }

    @property
    def held(self) -> HeldMechanism | None:
        """The mechanism in which things are held."""
        return self.events.held if self.events else None

    @property
    def _described_held(self) -> dict[str, object]:
        """The same of it, and the larger numbers of both: rows, numbers in matrices and factors."""
        described, held = self._described, self.held
        if held is None:
            room = {name: described[name] for name in ("nonzeros", "vectors")} | {"rows": self.kernels.m, "factor": self._order.nonzeros}
            return {"held": None, "room": room}
        other = self.of_held
        room = {"rows": held.kernels.m, "nonzeros": other._described["nonzeros"], "factor": other._order.nonzeros}
        room |= {"vectors": row_vectors(held.kernels.m, -1)}
        changing = {"rank": -1}  # as many rows are independent as are there with what is held
        return {"held": {"prefix": other.prefix, "m": held.kernels.m, **other._described, **changing}, "room": room}

    @cached_property
    def of_held(self) -> Package:
        """The same of the mechanism in which things are held, which there is."""
        assert self.held is not None
        return replace(self, sources=self.held.sources, kernels=self.held.kernels)

    @property
    def public(self) -> tuple[str, ...]:
        """Names of the headers an embedder includes."""
        headers = (f"{self.prefix}.h", f"{self.prefix}_motion.h")
        return (*headers, *(renamed(name, self.prefix) for name in PUBLIC))

    @cached_property
    def records(self) -> dict:
        """What the templates of all targets are filled with."""
        programs = self.sources.programs
        operations = {name: cost(program).total for name, program in programs.programs.items()}
        return {
            "version": __version__,
            "model": self.kernels.model,
            "coordinates": self.kernels.coordinates,
            "units": [self.unit(name) for name in self.kernels.coordinates],
            "rows": self.kernels.rows,
            "parameters": programs.equations.parameters,
            "defaults": [float(value) for value in self.kernels.p0],
            "dof": self.dof,
            "duration": self.duration,
            "operations": operations,
            **self._costs(operations),
            "numbers": 4 + 3 * self.kernels.n,
            "inputs": self.kernels.inputs,
            "outputs": list(self.kernels.model.outputs.values()),
            "uses_loads": uses_loads(self.kernels.model),
            "indices": [
                ("q", labels(self.kernels.coordinates)),
                ("p", labels(self.kernels.parameters)),
                ("output", labels(tuple(self.kernels.model.outputs))),
                ("event", labels(tuple(self.events.names if self.events else ()))),
            ],
            "kernel_shapes": [
                {"name": name, "inputs": program.inputs, "size": program.size} for name, program in programs.programs.items()
            ],
            "tangents": self.tangents is not None,
            "breaks": self.switching.described if self.switching else None,
            "events": self.events.described if self.events else None,
            "joint_loads": bool(self.loads),
            **program_records(self._motion_programs(), self.prefix, "motion"),
        }

    def _costs(self, kernels: dict[str, int]) -> dict[str, object]:
        """Operations of a step in C: as a rule, and at most, with every loop of the runtime taken to its end."""
        comments = re.findall(r"^/\* (\w+): (\d+) operations", "\n".join(self.recursion.values()), flags=re.MULTILINE)
        costs = {name: int(count) for name, count in comments}
        order = self._order
        below = np.diff(order.column_start)
        factor, solve = int(np.sum(below * (below + 3))), 4 * order.nonzeros + order.size
        matrix = sum(kernels.get(name, 0) for name in ("mass", "phi_q", "nu", "gamma", "force", "energy")) + factor + solve
        closing = kernels.get("phi", 0) + solve
        usual = 5 * matrix + 3 * closing
        refinements = constant_of("ncgen_solution.c", "REFINEMENT_LIMIT")
        positions = constant_of("ncgen_closing_rules.h", "NCGEN_POSITION_LIMIT")
        velocities = constant_of("ncgen_projection.c", "VELOCITY_LIMIT")
        vectors = row_vectors(self.kernels.m, self.rank)
        choice = (factor + 2 * vectors * solve + 4 * vectors**2 * (self.kernels.n + self.kernels.m)) if vectors else 0
        most = 5 * (matrix + refinements * 2 * solve) + choice + positions * (closing + matrix) + velocities * 2 * solve
        if costs:
            usual = 5 * costs["derivative"] + 2 * (costs["newton"] + costs["velocities"])
            most += 5 * costs["derivative"] + 2 * positions * costs["newton"] + velocities * costs["velocities"]
        return {"recursion": costs, "by_matrix": matrix, "usual": usual, "most": most}

    def _motion_programs(self) -> list[Program]:
        """What stands next to the kernels as functions."""
        closing = [self.full.closing, self.tangents.closing, self.tangents.motion] if self.tangents else []
        switches = [self.switching.program] if self.switching else []
        happening = self.events.programs if self.events else []
        return [*closing, *self.loads, *(self.outputs if self.tangents else self.outputs[:1]), *switches, *happening]

    @cached_property
    def switching(self) -> Switching | None:
        """When laws of time change their formula; None where none does."""
        return assemble_switches(self.kernels, self.sources.programs.equations, self.duration)

    @cached_property
    def events(self) -> EventTable | None:
        """What happens on the way; None where nothing does."""
        return EventTable(self.kernels, self.sources.programs.equations) if has_events(self.kernels.model) else None

    @cached_property
    def outputs(self) -> list[Program]:
        """What the model's outputs are, and how they change; [] without any."""
        if not self.kernels.model.outputs:
            return []
        programs = assemble_outputs(self.sources.programs.equations)
        return [replace(program, name=name) for program, name in zip(programs, ("outputs_of", "outputs_derivative"), strict=True)]

    def unit(self, coordinate: str) -> str:
        """Unit of a free coordinate: m, rad, or 1 for a component of a unit vector."""
        return next(e.unit for e in self.kernels.model.elements.values() if any(c.name == coordinate for c in e.components))


def package(model: Model, events: bool = False) -> Package:
    """Generate a mechanism and its motion; events: whether the target supports them. Raises ModelError where its motion has no export."""
    _require_none(model, _refusal(model, events))
    sources, kernels = _generated(model)
    run = _simulation(kernels)
    start = begin(kernels, run.initial, partitioned=True)
    _require_none(model, refusal_of_shared(kernels, start.q))
    positions = trial_positions(kernels, start.q, 0.0, None)
    sizes = MotionSizes(kernels.column_sizes, *(tuple(map(f, positions)) for f in (kernels.jacobian, kernels.mass_matrix)))
    if not np.any(sizes.W):
        raise ModelError(f"{model.name} cannot be exported: nothing has mass; give a body one")
    if uses_loads(model):
        warn_of_shared(instant(kernels, 0.0, start.q, start.qd, kernels.p0))
    independent = determined(start.partitions).velocity.names(kernels)
    return Package(
        sources=sources,
        kernels=kernels,
        sizes=sizes,
        q=start.q,
        qd=start.qd,
        independent=independent,
        duration=run.duration,
        dof=freedom(kernels).dof,
    )


def _generated(model: Model) -> tuple[Sources, Kernels]:
    """A mechanism with switches of what it may hold, unless its loads are not known: then gaps at rest end the motion."""
    sources = generate(with_switches(model))
    kernels = compile(sources, backend="numpy")
    if not (why := refusal_of_loads(kernels)):
        return sources, kernels
    if others := [*model.frictions, *model.contacts, *model.ratchets, *model.locks]:
        _require_none(model, f"{listed_names(others)} may not be held: {why}; use ncgen.simulate")
    sources = generate(model)
    return sources, compile(sources, backend="numpy")


def _require_none(model: Model, reason: str | None) -> None:
    """Raise ModelError where there is a reason why a model has no export."""
    if reason:
        raise ModelError(f"{model.name} cannot be exported: {reason}")


def _simulation(kernels: Kernels) -> Run:
    """The run that the model describes. Raises ModelError where it cannot be asked for, or begins as no export does."""
    options = simulation_of(kernels.model)
    check_options(options)
    run, refused = Run.from_arguments(kernels, **options), f"{kernels.name} cannot be exported: its simulation"
    if run.initial.t != 0:
        raise ModelError(f"{refused} begins at t0 = {run.initial.t:.6g} s, an export at 0; describe the motion from 0 on")
    for name, value, default in zip(kernels.parameters, run.initial.p, kernels.p0, strict=True):
        if value != default:
            raise ModelError(f"{refused} has p of its own: {name} = {value:.6g}; make that the parameter's default")
    return run


def _refusal(model: Model, events: bool) -> str | None:
    if model.callbacks:
        return "it calls a Python function"
    if has_events(model) and not events:
        names = shortened(", ".join(names_of_events(model)))
        return f"this export does not support events yet ({names}); take c, fmu2, fmu3, html, python or wasm"
    if reason := _refusal_of_events(model):
        return reason
    if model.branches:
        return "the paper's sine-or-cosine constraints change between steps; use smooth angles"
    return None


def _refusal_of_events(model: Model) -> str | None:
    """Why the events of a model cannot be exported, in words, or None."""
    if reason := refusal_of_frictions(model):
        return reason
    if called := [event.name for event in model.events.values() if event.is_called]:
        return f"event {called[0]} calls a Python function; write what it does as expressions"
    known = (Change, Impact, Locking, Stop)
    if unknown := [event.name for event in model.events.values() if not all(isinstance(action, known) for action in event.do)]:
        return f"what event {unknown[0]} does is not exported yet; use ncgen.simulate"
    return None


def renamed(text: str, prefix: str) -> str:
    """Names of C and of files that begin like ncgen's, with the model's name before them."""
    text = re.sub(r"\bncgen(?=_\w|\.[hc]\b)", f"{prefix}_ncgen", text)
    return re.sub(r"\bNCGEN_(?=\w)", f"{prefix.upper()}_NCGEN_", text)


def without_runtime(target: str, file_name: str, prefix: str, records: dict, headers_besides: tuple[str, ...]) -> dict[str, str]:
    """{path in the folder: text} of functions in C that need a few headers of ncgen's and nothing else of its runtime.

    file_name: the template of the functions, with its header; headers_besides: templates of what else is in the folder
    """

    def filled(template: str) -> str:
        return render(f"package/{target}/{template}.jinja", **records)

    files = {name: filled(name) for name in headers_besides} | {f"{prefix}_{target}.{end}": filled(f"{file_name}.{end}") for end in "hc"}
    headers = runtime_files(*needed_by(*re.findall(r'^#include "(ncgen\w*\.h)"', files[f"{prefix}_{target}.c"], flags=re.MULTILINE)))
    return {name: renamed(text, prefix) for name, text in files.items()} | {
        renamed(name, prefix): renamed(text, prefix) for name, text in headers.items()
    }
