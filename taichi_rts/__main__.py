"""`python -m taichi_rts` is `taichi-rts`."""

from taichi_rts.cli import main

main()
