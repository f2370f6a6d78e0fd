"""How fast the solver is, compared with another code and with the project's targets: `python -m taichi_rts.benchmarks`,
`taichi-rts bench`.
"""
