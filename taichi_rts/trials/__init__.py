"""Trial runs: to the largest stable step, repeated, in other processes."""
