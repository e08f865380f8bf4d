"""Equilibria, small motions beside steady ones, and linear systems for control."""
