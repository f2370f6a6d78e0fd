"""From shapes to particles, of fluid and of walls."""
