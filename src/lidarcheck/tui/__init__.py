"""The terminal interface. Empty so far."""
