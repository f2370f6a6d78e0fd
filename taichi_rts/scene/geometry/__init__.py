"""Solids: signed distances, surfaces, meshes, and how they move."""
