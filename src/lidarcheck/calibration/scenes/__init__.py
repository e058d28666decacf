"""Comparing a whole measured scene with what the model shows of it, part by part.

`workflow` says what is done in which order, `rank` which part disagrees most.
"""
