"""Stability: the criteria of survival, hard cases, and the largest stable step of each stepper."""
