"""The rows 1000-1003 as a table: Φ = ½ qᵀH q + bᵀq + c, so Φ_q = qᵀH + bᵀ and γ = −q̇ᵀH q̇ (natural coordinates, 2.6).

Parameters count with their defaults.
"""

from __future__ import annotations

import numpy as np

from ncgen.model.values import evaluate

LEFT_RIGHT = {1000: ("a", "a"), 1001: ("u", "u"), 1002: ("u", "a"), 1003: ("u", "v")}
CONSTANT = {
    1000: lambda L: L**2,
    1001: lambda: 1.0,
    1002: lambda L, c: L * c,
    1003: lambda c: c,
}
DIVISOR = {1000: lambda L: 2 * L, 1001: lambda: 2.0, 1002: lambda L, c: L, 1003: lambda c: 1.0}


class QuadraticRows:
    """(H, b, c) of the model's rows with codes 1000-1003; `numbers` are their positions among all rows."""

    def __init__(self, model):
        self.components = model.components
        self.parameters = model.parameters
        self.numbers = [i for i, row in enumerate(model.rows) if row.code in CONSTANT]
        tables = [self._table(model.rows[i]) for i in self.numbers]
        free = np.array([not c.fixed for c in self.components])
        held = np.array([c.initial if c.fixed else 0.0 for c in self.components])
        H = np.array([h for h, _ in tables]).reshape(-1, len(free), len(free))
        c = np.array([c for _, c in tables])
        self.H, self.b = H[:, free][:, :, free], (H @ held)[:, free]
        self.c = 0.5 * np.einsum("i,rij,j->r", held, H, held) - c

    def _table(self, row):
        """Φ·divisor = left·right − constant, over all coordinates: H = l rᵀ + r lᵀ summed over x, y, z."""
        left, right = (self._rows(row.arguments[name]) for name in LEFT_RIGHT[row.code])
        data = {name: evaluate(value, self.parameters, name) for name, value in row.data.items()}
        divisor = DIVISOR[row.code](**data) if row.scaled else 1.0
        return (left.T @ right + right.T @ left) / divisor, CONSTANT[row.code](**data) / divisor

    def _rows(self, combination):
        matrix = np.zeros((3, len(self.components)))
        for weight, element in combination.terms:
            for k, component in enumerate(element.components):
                matrix[k, self.components.index(component)] += weight
        return matrix

    def phi(self, q):
        return 0.5 * np.einsum("i,rij,j->r", q, self.H, q) + self.b @ q + self.c

    def phi_q(self, q):
        return self.H @ q + self.b

    def gamma(self, qd):
        return -np.einsum("i,rij,j->r", qd, self.H, qd)

    def size(self, q):
        """The sum of absolute values of the terms of Φ: what rounding is measured by."""
        return 0.5 * np.einsum("i,rij,j->r", abs(q), abs(self.H), abs(q)) + abs(self.b) @ abs(q) + abs(self.c)
