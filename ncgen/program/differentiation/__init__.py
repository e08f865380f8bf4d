"""Derivatives of programs as programs, and what depends on parameters alone."""
