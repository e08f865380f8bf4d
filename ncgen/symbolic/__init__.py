"""What a model means: every row, mass and force derived once by sympy, and bound to its places in q."""
