"""`python -m taichi_rts` is `taichi-rts`."""

from taichi_rts.commands.main import main

main()
