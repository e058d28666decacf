"""Scenes: shapes and meshes in front of the sensor, ray-cast into ideal scans."""

from __future__ import annotations

from lidarcheck.scenes.facets import Facets
from lidarcheck.scenes.optics import Optics
from lidarcheck.scenes.scene import Scene, SceneObject

__all__ = ["Facets", "Optics", "Scene", "SceneObject"]
