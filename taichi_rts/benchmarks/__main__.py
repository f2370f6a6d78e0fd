"""`python -m taichi_rts.benchmarks`."""

import tyro

from taichi_rts.benchmarks.command import Bench
from taichi_rts.terminal import execute

if __name__ == "__main__":
    execute(tyro.cli(Bench, prog="taichi-rts bench"))
