"""Equilibria, small motions near steady ones, and linear systems for control."""
