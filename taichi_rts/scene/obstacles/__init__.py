"""Rigid bodies in the fluid: one file for each shape, with its description and its geometry."""
