"""Motions that need no solver: mechanisms turned about z as a whole, which keeps every distance and angle in them."""

from __future__ import annotations

import numpy as np

HOSTILE = "</script><script>document.body.dataset.broken='yes'</script><img src=x onerror=\"document.title='broken'\">&'\""


class TurningRun:
    """A stand-in with the interface of a trajectory: the model's initial position turned by `rate` (rad/s) over t."""

    def __init__(self, model, t, rate=1.0, massless=False):
        self.model, self.name, self.t = model, model.name, np.asarray(t, dtype=float)
        self.massless = massless
        self.coordinates = tuple(c.name for e in model.elements.values() for c in e.components if not c.fixed)
        c, s, zero = np.cos(rate * self.t), np.sin(rate * self.t), np.zeros_like(self.t)
        self.rotation = np.array([[c, -s, zero], [s, c, zero], [zero, zero, zero + 1]]).transpose(2, 0, 1)

    def point(self, name):
        return self.rotation @ self.model.elements[name].initial

    vector = point

    def __getitem__(self, name):
        element = self.model.elements.get(name)
        if element is not None:
            return element.initial + np.sin(self.t)
        owner, axis = name.rsplit(".", 1)
        return self.point(owner)[:, "xyz".index(axis)]

    def energy(self):
        kinetic = (0.0 if self.massless else 3.0) * np.sin(self.t) ** 2
        return np.stack([kinetic, -kinetic, 0 * kinetic], axis=1)

    def violation(self):
        return 1e-13 * np.abs(np.sin(self.t))
