"""What ali3p is, its stepper says; accelerations of single instants are Lagrange's."""

from ncgen.solver.formalisms.lagrange import lagrange as ali3p

__all__ = ["ali3p"]
