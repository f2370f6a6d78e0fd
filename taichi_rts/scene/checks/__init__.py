"""What can be wrong with a scene."""
