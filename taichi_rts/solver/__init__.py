"""The method on the device."""
