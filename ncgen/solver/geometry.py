"""Points, vectors and directions at a position q: the way back from coordinates to pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ncgen.errors import ModelError
from ncgen.model.elements import Angle, Combination, Element
from ncgen.model.values import evaluate
from ncgen.solver.protocol import Kernels


def component(kernels: Kernels, c, q, p=None) -> np.ndarray:
    """One coordinate at positions q (…, n): a free one from q, a fixed one from its value at parameters p."""
    q = np.asarray(q)
    if c.fixed:
        return np.full(q.shape[:-1], evaluate(c.value, parameters_at(kernels, p), c.name))
    return q[..., kernels.index[c.name]]


def parameters_at(kernels: Kernels, p) -> dict:
    """The model's parameters with the numbers of p for their defaults."""
    known = kernels.model.parameters
    return known if p is None else {k: replace(v, default=float(x)) for (k, v), x in zip(known.items(), p, strict=True)}


def element(kernels: Kernels, thing: str | Element, q, p=None) -> np.ndarray:
    """A point or a vector at positions q (…, n), shape (…, 3); an angle, shape (…, 1).

    Raises ModelError for a name the model does not have.
    """
    if isinstance(thing, str):
        thing = _named(kernels, thing)
    return np.stack([component(kernels, c, q, p) for c in thing.components], axis=-1)


def element_rate(kernels: Kernels, thing: str | Element, qd) -> np.ndarray:
    """The velocity of an element: fixed components stand still."""
    if isinstance(thing, str):
        thing = _named(kernels, thing)
    qd = np.asarray(qd)
    parts = [np.zeros(qd.shape[:-1]) if c.fixed else qd[..., kernels.index[c.name]] for c in thing.components]
    return np.stack(parts, axis=-1)


def direction(kernels: Kernels, combination: Combination, q, p=None) -> np.ndarray:
    """A linear combination of elements at positions q, shape (…, 3)."""
    weights = [evaluate(w, parameters_at(kernels, p), str(combination)) for w, _ in combination.terms]
    return sum(w * element(kernels, e, q, p) for w, (_, e) in zip(weights, combination.terms, strict=True))


def measured_angle(kernels: Kernels, angle: Angle, q, p=None) -> np.ndarray:
    """The angle between its elements as they stand at q, in (−π, π], whatever its coordinate says."""
    a, b, n = (direction(kernels, d, q, p) for d in (angle.start, angle.end, angle.axis))
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)

    def dot(x, y):
        return np.sum(x * y, axis=-1)

    return np.arctan2(dot(np.cross(a, b), n), dot(a, b) - dot(a, n) * dot(b, n))


def angles(kernels: Kernels) -> list[Angle]:
    return [e for e in kernels.model.elements.values() if isinstance(e, Angle)]


def _named(kernels: Kernels, name: str) -> Element:
    if name not in kernels.model.elements:
        raise ModelError(f"{kernels.name} has no point, vector or angle {name}; it has {', '.join(kernels.model.elements)}")
    return kernels.model.elements[name]
