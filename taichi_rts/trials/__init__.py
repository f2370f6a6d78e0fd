"""Runs that are tried out: until they blow up, again and again, in other processes."""
