"""The state of the fluid."""
