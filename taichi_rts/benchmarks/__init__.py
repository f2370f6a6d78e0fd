"""How fast the solver is, beside a peer and beside its own bars: `python -m taichi_rts.benchmarks`, `taichi-rts bench`."""
