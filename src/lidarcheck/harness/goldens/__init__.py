"""Goldens: what is in one, its file, where it came from, and the state of the repository that holds it.

`golden` builds one from measured seeds, `file` reads and writes it, `provenance` says what it was made with.
"""
