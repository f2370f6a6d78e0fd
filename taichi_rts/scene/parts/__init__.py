"""The parts that a scene is described by."""
