"""What is measured, section by section: (title, records)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from benchmarks import arms
from benchmarks.data import data_records
from benchmarks.generation import generation_records
from benchmarks.gradients import STEPS, gradient_records
from benchmarks.libraries import MOTIONS, library_records
from benchmarks.libraries import STEPS as LIBRARY_STEPS
from benchmarks.positions import worst_errors
from benchmarks.rivals import articulated, lambdified
from benchmarks.students import student_records
from ncgen.comparisons import bench
from ncgen.comparisons.batches import RUNS, STATES, batch_records
from ncgen.comparisons.derivative_parts import RatedPart, arithmetic_rate, derivative_records
from ncgen.comparisons.falls import fall_records
from ncgen.comparisons.rivals.base import own_start
from ncgen.compiler import compile
from ncgen.exchange.examples import example_names
from ncgen.mechanism.library import CompiledKernels
from ncgen.model import Model
from ncgen.report.repeat import runner
from ncgen.solver.engines.partition_dynamics import split_of

Sections = Iterator[tuple[str, list[dict]]]

ARTICULATED = "articulated body, CasADi"
"""What computes the accelerations of an arm from its angles, in C that another generator writes."""


def everything(model: Model) -> Sections:
    """The sections of `ncgen bench`, next to what others have; generation and compilation."""
    kernels = compile(model, "c")
    rate = arithmetic_rate()
    yield bench.KERNEL_TITLE.format(model.name), bench.kernel_records(model, rate, lambdified.rivals)
    found = derivative_records(kernels, rate, by_articulated_bodies, worst_errors(kernels)) if kernels.m else []
    yield bench.DERIVATIVE_TITLE.format(rate / 1e9), found
    yield bench.FALL_TITLE, list(fall_records(kernels, student_records))
    yield "generation and compilation, seconds", generation_records(model.name) if model.name in example_names() else []
    yield bench.BATCH_TITLE.format(STATES, RUNS), list(batch_records(kernels))


def by_articulated_bodies(kernels: CompiledKernels, q: np.ndarray, zd: np.ndarray) -> dict[str, RatedPart]:
    """The accelerations of an arm by CasADi; nothing for other mechanisms, and where it is not installed."""
    found = articulated.rival(kernels, split_of(own_start(kernels)[1].velocity))
    if found is None:
        return {}
    call, operations, _ = found
    return {ARTICULATED: RatedPart(runner(0.0, q, zd, kernels.p0, [], call), call.out.copy, operations)}


def of_arms(seed: int) -> Sections:
    """Arms next to other programs."""
    yield from ((arms.title(records[0]), records) for records in arms.arm_records(seed=seed))


def of_gradients(model: Model) -> Sections:
    """Derivatives of a whole motion."""
    title = f"derivatives of a motion of {model.name} with {STEPS} steps of rk4 by its data: ms, error relative to the largest"
    yield title, list(gradient_records(model))
    yield from of_data([model])


def of_libraries(model: Model) -> Sections:
    """Many motions inside other libraries."""
    what = f"{MOTIONS:,} motions of {model.name} with {LIBRARY_STEPS} steps of rk4, and their gradients by all data"
    yield f"{what}: ms a motion, difference from ncgen", list(library_records(model))


def of_data(models: Iterable[Model]) -> Sections:
    """What data as parameters cost."""
    title = "operations of the state derivative over all coordinates: with numbers, and with parameters in their place"
    yield title, [record for model in models for record in data_records(model)]
