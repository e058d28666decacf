"""The screen Explain."""
