"""Files that are either complete or absent: writing, locking, archives, films."""
