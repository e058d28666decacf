"""The fast path: echoes of beams with one pulse, drawn from a library that the exact chain fills."""
