"""Ideal scans of scenes. Empty until shapes and meshes are ray-cast here."""
