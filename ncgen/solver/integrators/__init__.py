"""Integrators in Python: SciPy's step-by-step solvers, and others that have the same face."""
