"""Fluid at the start: one file for each shape, with its description, its lattice and how it moves."""
