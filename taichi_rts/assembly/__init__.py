"""From a scene and a stepper to a run, and what is asked of a run as a whole."""
