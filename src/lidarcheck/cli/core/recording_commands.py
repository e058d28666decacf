"""The commands from a recording to a case: ideal scans from measurements, cases, and the quick start."""

from __future__ import annotations

from lidarcheck.cli.core.command import Command

__all__ = ["RECORDING_COMMANDS"]

RECORDING_COMMANDS: tuple[Command, ...] = (
    Command(
        "ideal from-snippet",
        "ideals.from_snippet",
        "SCAN ... (--region BOX | --beams SPAN) (--sensor S | --model M) --out IDEAL [OPTIONS]",
        "Make an ideal scan of a target cut out of scans.",
        "The target is a plane, a cylinder or a mesh. Its pose is given, or a robust fit finds it in the echoes of "
        "the region and leaves out what does not lie on it. Then the sensor's beams are cast: those that meet the "
        "target have distance, incidence and material, those beside its edge are marked, and nothing is known of others.",
        (
            "lidarcheck ideal from-snippet panel_*.pcd --region 9,11,-1,1,-0.5,1 --sensor XT32 --out ideal.parquet",
            "lidarcheck ideal from-snippet hall.pcd --beams 20,60,300,420 --form cylinder --model m.toml --out i.txt",
        ),
    ),
    Command(
        "ideal from-map",
        "ideals.from_map",
        "MESH|CLOUD --poses FILE (--sensor S | --model M) --out DIR [OPTIONS]",
        "Make ideal scans of a registered map, from each pose.",
        "The sensor's beams are cast into the map from each pose, or with --swept on the way between poses. A mesh is "
        "taken as it is, and what it does not show is empty; a cloud becomes flat pieces, each with its error, and "
        "between them nothing is known. DIR gets a file a pose, of the pose's name.",
        (
            "lidarcheck ideal from-map hall.ply --poses poses.csv --sensor XT32 --out ideals",
            "lidarcheck ideal from-map street.laz --poses drive.txt --swept --model model.toml --out ideals",
        ),
    ),
)
