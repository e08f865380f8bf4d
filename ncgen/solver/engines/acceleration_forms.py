"""State derivatives in C over all coordinates: which form of accelerations a run takes, of a recursion or of the factored matrix."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from ncgen.errors import NcgenError
from ncgen.mechanism import numbered
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.methods.method import Method
from ncgen.methods.table import AUTO
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.open_tree import KnownTree, known_tree, why_no_tables
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.runs.choice import Choice, choose
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.settings import COMPILED, Form, Settings
from ncgen.symbolic.tree import spanning_tree

if TYPE_CHECKING:
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
    from ncgen.mechanism.motion_sources import Seen
    from ncgen.mechanism.runtime_library import Part
    from ncgen.model import Model
from ncgen.solver.engines.capabilities import refusal
from ncgen.solver.engines.partition_dynamics import samples, split_of

MOST_RATES = 60
"""Rates of a tree of bodies up to which a recursion is written out where nobody asked for it: it is compiled in some seconds."""

FEW_RATES = 20
"""The same of a tree that moves in loops over tables, too, at two to three times the cost: an arm of 20 takes 10,000 operations, which are
assembled and compiled in 2 s."""


def all_coordinates(kernels: Kernels, number: str = "double", form: Form = "dense", integrator: str = AUTO) -> ConstrainedDynamics:
    """The state derivative over all coordinates, made once for every kernels object, number type and form.

    form: "emitted" for accelerations that are emitted, seen in positions around the model's own start, so that they are the same in
        every run; "tree" for those in loops over tables of an open tree; else of the factored matrix
    integrator: for which the runtime is compiled at the same time
    """

    def made() -> ConstrainedDynamics:
        from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
        from ncgen.mechanism.runtime_library import part_for

        samples_of = partial(own_positions, kernels, 0) if form == "emitted" and _has_few_rates(kernels, least=0) else None
        tree = _tree_with_loops(kernels) if form == "tree" else None
        component = part_for(integrator, "emitted" if samples_of else "tree" if tree else None)
        return ConstrainedDynamics(kernels, number, samples_of, tree.tables if tree else None, component)

    return kernels.remember("constrained dynamics", (number, form), made)


def expected_component(model: Model, run: Run) -> Part:
    """The part of the runtime that a run will need as far as the model alone shows, to be compiled while kernels are derived."""
    from ncgen.mechanism.runtime_library import part_for

    method, tree = choose(run.settings).method, spanning_tree(model)
    is_open = run.settings.engine in (AUTO, COMPILED) and run.settings.number == "double" and not model.branches
    if method.formalism.name != "lagrange" or not is_open or not tree.dof:
        return part_for(method.integrator.name)
    has_loops = len(model.joints) > len(tree.links)
    emitted = tree.dof <= (MOST_RATES if has_loops else FEW_RATES)
    return part_for(method.integrator.name, "emitted" if emitted else None if has_loops else "tree")


def form_of(kernels: Kernels, method: Method) -> Form:
    """What accelerations a run over all coordinates takes where nobody says: of a recursion over the tree of bodies that is emitted
    and compiled, or in loops over tables, or of the factored matrix. Asked once for a mechanism and a method."""
    formalism, stabilisation = method.formalism, method.options.get("stabilisation")
    key = kernels.effort, formalism.name, formalism.in_c, method.integrator.name, stabilisation
    return kernels.remember("form of accelerations", key, lambda: _form_of(kernels, method))


def _form_of(kernels: Kernels, method: Method) -> Form:
    if _may_recur(kernels, method) and not _has_few_rates(kernels, FEW_RATES) and known_tree(kernels):
        return "tree"
    if _is_recursive(kernels, method):
        return "emitted"
    return "tree" if _may_recur(kernels, method) and _tree_with_loops(kernels) else "dense"


def _tree_with_loops(kernels: Kernels) -> KnownTree | None:
    """Of an open tree, or of one whose loops are closed by constraints."""
    return known_tree(kernels) or known_tree(kernels, closes_loops=True)


def explained(kernels: Kernels, choice: Choice, settings: Settings, engine: str) -> str:
    """The method and the engine that a run took, and why; of a large tree of bodies why it is the matrix, too."""
    is_open = settings.engine in (AUTO, COMPILED) and engine == "c" and settings.number == "double"
    matrix = why_matrix(kernels, choice.method) if is_open else ""
    return f"{choice.method}, {engine}: {choice.why}" + (f"; {matrix}" if matrix else "")


def why_matrix(kernels: Kernels, method: Method) -> str:
    """Why a tree of bodies that is too large to be emitted takes accelerations from the factored matrix; empty where it does not."""
    if not _may_recur(kernels, method) or _has_few_rates(kernels, least=0):
        return ""
    reason = why_no_tables(kernels)
    return f"the matrix, since {reason}" if reason else ""


def _may_recur(kernels: Kernels, method: Method) -> bool:
    """True where a recursion could give the accelerations of a method."""
    if (
        kernels.model.branches
        or refusal(kernels, method, "c", "double")
        or not (method.formalism.name == "lagrange" and method.integrator.takes_recursion)
    ):
        return False
    return method.options.get("stabilisation") == "projection"


def has_emitted_recursion(kernels: Kernels, method: Method, least: int = 1) -> bool:
    """True where a run over all coordinates takes its accelerations from a recursion that is emitted and compiled, with all forces.

    least: rates of the tree of bodies; with 0 of them, as of points alone, a run takes others, but there is such a recursion
    """
    callbacks = kernels.model.callbacks
    return (not callbacks or ReactiveForce.only(callbacks) is not None) and _is_recursive(kernels, method, least)


def _is_recursive(kernels: Kernels, method: Method, least: int = 1) -> bool:
    from ncgen.mechanism.library import CompiledKernels

    if not isinstance(kernels, CompiledKernels) or not _has_few_rates(kernels, least=least):
        return False
    return _may_recur(kernels, method) and all_coordinates(kernels, form="emitted", integrator=method.integrator.name).is_emitted


def _has_few_rates(kernels: Kernels, most: int | None = None, least: int = 1) -> bool:
    """True for a tree of bodies that can be emitted: without compiling for long, unless the kernels are to be of the most effort.

    least, most: rates (default: MOST_RATES)
    """
    structure = numbered.of(kernels.programs)
    freedoms = spanning_tree(kernels.model).dof if structure is None else structure.rates
    return least <= freedoms and (kernels.effort == "most" or freedoms <= (MOST_RATES if most is None else most))


def own_positions(kernels: Kernels, least: int = 1) -> Seen | None:
    """Independent coordinates of the positions at a model's own start, and `samples` around it; None where there are none, or less than the
    least rates."""
    if not _has_few_rates(kernels, least=least):
        return None
    try:
        q = assemble(kernels, kernels.q0)
        return split_of(choose_partitions(kernels, q).position), samples(kernels, q, kernels.p0)
    except NcgenError:
        return None
