"""Densities, forces and walls, pair by pair."""
