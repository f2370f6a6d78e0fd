"""`python -m taichi_rts.benchmarks`."""

import sys

from taichi_rts.cli import main

if __name__ == "__main__":
    main(["bench", *sys.argv[1:]])
