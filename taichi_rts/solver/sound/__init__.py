"""The regional sound speed."""
