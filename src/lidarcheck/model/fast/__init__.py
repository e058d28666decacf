"""The fast path: echoes drawn from libraries that the exact chain fills, and in haze joined to shared histories."""
