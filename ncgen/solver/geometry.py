"""Points, vectors and directions at a position q: from coordinates to pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import Angle, Combination, Component, Element
from ncgen.model.values import Parameter, evaluate, is_number

Arms: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def component(kernels: Kernels, c: Component, q: ArrayLike, p: np.ndarray | None = None) -> np.ndarray:
    """One coordinate at positions q (…, n): a free one from q, a fixed one from its value at parameters p."""
    q = np.asarray(q)
    if c.fixed:
        return np.full(q.shape[:-1], evaluate(c.value, parameters_at(kernels, p), c.name))
    return q[..., kernels.index[c.name]]


def parameters_at(kernels: Kernels, p: np.ndarray | None) -> dict[str, Parameter]:
    """The model's parameters with the numbers of p for their defaults."""
    known = kernels.model.numbers
    return known if p is None else {k: replace(v, default=float(x)) for (k, v), x in zip(known.items(), p, strict=True)}


def element(kernels: Kernels, reference: str | Element, q: ArrayLike, p: np.ndarray | None = None) -> np.ndarray:
    """A point or a vector at positions q (…, n), shape (…, 3); an angle, shape (…, 1).

    Raises ModelError for a name the model does not have.
    """
    if isinstance(reference, str):
        reference = _named(kernels, reference)
    return np.stack([component(kernels, c, q, p) for c in reference.components], axis=-1)


def element_rate(kernels: Kernels, reference: str | Element, qd: ArrayLike) -> np.ndarray:
    """The velocity of an element: fixed components stand still."""
    if isinstance(reference, str):
        reference = _named(kernels, reference)
    qd = np.asarray(qd)
    parts = [np.zeros(qd.shape[:-1]) if c.fixed else qd[..., kernels.index[c.name]] for c in reference.components]
    return np.stack(parts, axis=-1)


def direction(kernels: Kernels, combination: Combination, q: ArrayLike, p: np.ndarray | None = None) -> np.ndarray:
    """A linear combination of elements at positions q, shape (…, 3)."""
    weights = [evaluate(w, parameters_at(kernels, p), str(combination)) for w, _ in combination.terms]
    parts = (w * element(kernels, e, q, p) for w, (_, e) in zip(weights, combination.terms, strict=True))
    return sum(parts, np.zeros(3))


def measured_angles(kernels: Kernels, q: ArrayLike, p: np.ndarray | None = None) -> np.ndarray:
    """The angles between their elements as they stand at q (…, n), in (−π, π], whatever their coordinates say, in the order of `angles`."""
    weights, rows, columns, fixed = _arms(kernels, p)
    products = weights * np.asarray(q)[..., columns]
    sums = np.zeros((len(fixed), *products.shape[:-1]))
    np.add.at(sums, rows, products.T)
    arms = sums.T + fixed
    arms = arms.reshape(*arms.shape[:-1], -1, 3, 3)
    products = arms @ arms.swapaxes(-1, -2)  # of a, b and the axis n, of any length
    ab, an, bn, nn = products[..., 0, 1], products[..., 0, 2], products[..., 1, 2], products[..., 2, 2]
    with np.errstate(invalid="ignore"):  # a state that is no number has no angles; whoever asks is told elsewhere
        volume = np.linalg.det(arms)
    return np.arctan2(np.sqrt(nn) * volume, nn * ab - an * bn)


def arms_have_parameters(kernels: Kernels) -> bool:
    """Whether what angles are measured between depends on the parameters."""
    arms = [d for angle in angles(kernels) for d in (angle.start, angle.end, angle.axis)]
    values = [v for arm in arms for weight, e in arm.terms for v in (weight, *(c.value for c in e.components if c.fixed))]
    return not all(map(is_number, values))


def _arms(kernels: Kernels, p: np.ndarray | None) -> Arms:
    """(weights, rows, columns, w): start, end and axis of all angles are W q + w at parameters p, where W has these entries; made once and
    kept for the last p."""
    p = kernels.p0 if p is None else p
    p = np.asarray(p, dtype=float)
    return kernels.remember("arms", p.tobytes(), lambda: _collect_arms(kernels, p), most=1)


def _collect_arms(kernels: Kernels, p: np.ndarray) -> Arms:
    parameters = parameters_at(kernels, p)
    wanted = [d for angle in angles(kernels) for d in (angle.start, angle.end, angle.axis)]
    fixed, entries = np.zeros(3 * len(wanted)), []
    for index, combination in enumerate(wanted):
        for weight, reference in combination.terms:
            weight = evaluate(weight, parameters, str(combination))
            for row, c in enumerate(reference.components, 3 * index):
                if c.fixed:
                    fixed[row] += weight * evaluate(c.value, parameters, c.name)
                else:
                    entries.append((weight, row, kernels.index[c.name]))
    weights, rows, columns = zip(*entries, strict=True) if entries else ((), (), ())
    return np.array(weights, float), np.array(rows, np.intp), np.array(columns, np.intp), fixed


def angles(kernels: Kernels) -> list[Angle]:
    """The angles that are free coordinates."""
    return [e for e in kernels.model.elements.values() if isinstance(e, Angle) and e.name in kernels.index]


def _named(kernels: Kernels, name: str) -> Element:
    if name not in kernels.model.elements:
        raise ModelError(f"{kernels.name} has no point, vector or angle {name}; it has {', '.join(kernels.model.elements)}")
    return kernels.model.elements[name]
