"""Counts that the device's arrays are laid out by, and that a scene's size is checked with."""

CELLS_PER_BLOCK = 2  # measured: 1, 2, 4, 8 cells take 225, 203, 269, 321 ns per particle and core in a density pass
