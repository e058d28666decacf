"""Goldens: what is in one, its file, where it came from, and the state of the repository that holds it."""
