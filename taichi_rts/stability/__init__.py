"""Where the solver holds and where it breaks: what a run must keep to, hard cases, and the largest stable step of each."""
