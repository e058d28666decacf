"""Cutting vehicles out of scans, comparing them with simulated ones, and merging them into one cloud."""
