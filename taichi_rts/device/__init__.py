"""Taichi and the device: the backend, scans, and a cache that spares the front end work."""
