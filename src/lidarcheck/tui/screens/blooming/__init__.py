"""The screen Blooming."""
