"""`python -m taichi_rts.benchmarks`."""

from taichi_rts.cli import main

if __name__ == "__main__":
    import sys

    main(["bench", *sys.argv[1:]])
