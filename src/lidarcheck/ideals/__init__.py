"""Ideal scans from measurements: from repeats of a scene at rest, from a target that is cut out, from a map."""
