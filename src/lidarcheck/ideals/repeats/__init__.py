"""Ideal scans from repeats of a scene at rest: what each ray meets by all frames but the one that is judged."""
