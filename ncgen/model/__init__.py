"""What the user says: points, vectors, angles, bodies, rows, forces, and the paper's tables."""

from ncgen.model.model import Model

__all__ = ["Model"]
