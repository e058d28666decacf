"""Noise on a laboratory's panels: which echoes lie on which panel, and how they scatter.

`workflow` says what is done in which order.
"""
