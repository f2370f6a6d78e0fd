"""Speed against error: which stepper, at which step, is worth it on a scene."""
