"""Counts that determine the layout of the device's arrays, also used to check a scene's size."""

CELLS_PER_BLOCK = 2  # measured: 1, 2, 4, 8 cells take 225, 203, 269, 321 ns per particle and core in a density pass
