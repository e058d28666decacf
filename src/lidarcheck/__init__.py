"""lidarcheck: calibrates and validates a LiDAR sensor model against measurements."""

__version__ = "0.1.0"
__all__ = ["__version__"]
