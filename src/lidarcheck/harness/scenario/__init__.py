"""Scenarios: the file, its beams, what it asks for, and measuring it.

`scenario` reads one, `shapes` lays its beams, `measure` runs one seed of it.
"""
