"""Afterpulses on the exact chain: counts for the many detectors that wait for none, a way of its own for each other."""
