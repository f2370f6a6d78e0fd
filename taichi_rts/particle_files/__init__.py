"""Particles in files of other tools: one module a format, all listed in `formats.FORMATS`. Knows nothing of simulations."""
