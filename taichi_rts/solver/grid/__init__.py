"""The block grid and sums over neighbours."""
