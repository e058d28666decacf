"""Avalanches that set off their neighbours, on the exact chain: counts, and places of the few that it concerns."""
