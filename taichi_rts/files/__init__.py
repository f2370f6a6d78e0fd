"""Files that are whole or not there: writing, locking, archives, films."""
