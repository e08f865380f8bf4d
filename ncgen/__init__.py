"""ncgen: multibody systems in natural coordinates, from equations to compiled kernels."""

from ncgen.model import Model

__version__ = "0.1.0"
__all__ = ["Model"]
