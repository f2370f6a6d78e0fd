"""Taichi and the device: the backend, scans, and what spares the front end work."""
