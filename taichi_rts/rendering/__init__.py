"""Pictures of particles: NumPy arrays in, NumPy images out; knows nothing of the solver.

`splatter` is the default renderer (Taichi kernels, any arch, no display), `ggui` needs Vulkan, `colours` and
`camera` are pure NumPy, `legend` draws the panels on top with Pillow.
"""
