"""Which particles step when. `base.py` says what a stepper is; each other stepper is one file."""
