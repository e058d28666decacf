"""Cutting vehicles out of scans, comparing them with simulated ones, and merging them into one cloud.

`cut` finds a vehicle, `compare` sets real against simulated at each distance, `merge` puts both into one cloud.
"""
