"""Finding signs and their ghosts in measured scans, and fitting the ghost effect to them.

`workflow` tells signs and ghosts from all else, `fit` fits the effect.
"""
