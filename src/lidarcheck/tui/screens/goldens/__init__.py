"""The screen Goldens."""
