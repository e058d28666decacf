"""The terminal interface. `core` is headless; what is outside of it knows textual and composes only."""
