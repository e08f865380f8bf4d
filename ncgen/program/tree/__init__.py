"""Recursion over the tree of bodies, as programs and as tables."""
