"""Builds a run from a scene and a stepper, and answers what concerns a run as a whole."""
