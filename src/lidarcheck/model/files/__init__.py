"""Model files: read, written, and changed in place without losing a comment."""
