"""The commands of sensor files."""

from __future__ import annotations

from lidarcheck.cli.core.command import Command

__all__ = ["SENSOR_COMMANDS"]

SENSOR_COMMANDS: tuple[Command, ...] = (
    Command(
        "sensor from",
        "sensor.from_",
        "FILE [--out SENSOR.toml] [OPTIONS]",
        "Make a sensor file from a vendor's calibration.",
        "FILE is recognised by its content: Ouster metadata JSON, Velodyne YAML or db.xml, Hesai angle CSV, Isaac RTX "
        "JSON or USD, HELIOS++ XML, SDF or URDF, CARLA attributes, OSI in JSON. What the file does not say stands as a "
        "line behind a hash, with what to look up. Without --out the text is printed. A sensor whose beams are a table "
        "gets it as a CSV beside --out. No file is replaced.",
        (
            "lidarcheck sensor from os1_metadata.json --out os1.toml",
            "lidarcheck sensor from VLP16db.yaml --rate 10 --out vlp16.toml",
            "lidarcheck sensor from XT32.csv --firetimes XT32_firetimes.csv --out xt32.toml",
        ),
    ),
)
