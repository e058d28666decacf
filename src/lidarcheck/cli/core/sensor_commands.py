"""The commands of sensor files."""

from __future__ import annotations

from lidarcheck.cli.core.command import Command

__all__ = ["SENSOR_COMMANDS"]

SENSOR_COMMANDS: tuple[Command, ...] = (
    Command(
        "sensor list",
        "sensor.list",
        "[OPTIONS]",
        "List the sensors that come with lidarcheck.",
        "By these names a model's variant, `scene --sensor` and `sensor show` know them.",
        ("lidarcheck sensor list",),
    ),
    Command(
        "sensor show",
        "sensor.show",
        "NAME|FILE [OPTIONS]",
        "Show what a sensor file says.",
        "Beams, times of firing, gate, detector, features and sources, with the pattern of a block of columns and of a "
        "whole frame; and what is missing for simulate.",
        (
            "lidarcheck sensor show OS1-128",
            "lidarcheck sensor show mine.toml --out mine.png",
            "lidarcheck sensor show mine.toml --json",
        ),
    ),
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
    Command(
        "sensor check",
        "sensor.check",
        "SCAN --sensor FILE [OPTIONS]",
        "Say how well a scan fits the beams of a sensor file.",
        "Rows get their beams by Layer and Point, by their place in an organised cloud, by ring and column, ring and "
        "time, ring and azimuth, or by their direction alone, and X, Y, Z are held against them. Prints the share of "
        "the rows that lie on their beams, how far they lie off, the worst layers, and what change of the sensor file "
        "would make the scan fit. Exit code 0: it fits; 1: it does not, or too few rows can be judged; 2: could not "
        "run.",
        (
            "lidarcheck sensor check scan.pcd --sensor xt32.toml",
            "lidarcheck sensor check scan.pcd --sensor xt32.toml --all --json",
        ),
    ),
    Command(
        "sensor guess",
        "sensor.guess",
        "SCANS ... [--ring NAME] [--out SENSOR.toml] [OPTIONS]",
        "Guess the beams of a sensor from its scans.",
        "Each ring's elevation is the median of its rows; without a column of rings, rows are dense at each elevation. "
        "The columns come from the azimuths within rings, the sense of turning and the fire times from the times, "
        "where beams start from how elevations change with the range. A ring of fewer than 50 rows, or that spreads "
        "by more than a tenth of the spacing, is not guessed. What scans do not show stands in the file as a line "
        "behind a hash.",
        (
            "lidarcheck sensor guess scan.pcd",
            "lidarcheck sensor guess scan_*.pcd --ring channel --rate 10 --out guess.toml",
        ),
    ),
)
