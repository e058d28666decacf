"""The exact chain on a GPU."""
