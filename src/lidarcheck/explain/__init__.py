"""The gap workflow: where model and measurement disagree, and why. Empty so far."""
