"""The commands that make data: simulate, scene, effects."""
