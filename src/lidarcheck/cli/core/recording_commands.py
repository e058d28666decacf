"""The commands from a recording to a case: ideal scans from measurements, cases, and the quick start."""

from __future__ import annotations

from lidarcheck.cli.core.command import Command

__all__ = ["RECORDING_COMMANDS"]

RECORDING_COMMANDS: tuple[Command, ...] = (
    Command(
        "ideal from-repeats",
        "ideals.from_repeats",
        "FRAMES ... (--sensor S | --model M) --out DIR|IDEAL [OPTIONS]",
        "Make ideal scans from repeats of a scene at rest.",
        "Each ray's surface is a range that comes again in more than half of the repeats; its distance is the median, "
        "its reflectance what makes the amplitudes and the losses likeliest. Each frame's ideal scan is made of the "
        "others, so that none judges itself. What the sensor's file leaves open (scatter of ranges and amplitudes, "
        "threshold) is fitted and written to model.toml. Two frames give these laws alone.",
        (
            "lidarcheck ideal from-repeats rest_*.pcd --sensor OS1-128 --out repeats",
            "lidarcheck ideal from-repeats rest --sensor mine.toml --out ideal.parquet",
        ),
    ),
    Command(
        "ideal from-snippet",
        "ideals.from_snippet",
        "SCAN ... (--region BOX | --beams SPAN) (--sensor S | --model M) --out IDEAL [OPTIONS]",
        "Make an ideal scan of a target cut out of scans.",
        "The target is a plane, a cylinder or a mesh. Its pose is given, or a robust fit finds it in the echoes of "
        "the region and leaves out what does not lie on it. Then the sensor's beams are cast: those that meet the "
        "target have distance, incidence and material, beams beside its edge are marked, of others nothing is known.",
        (
            "lidarcheck ideal from-snippet a.pcd --beams 2,6,30,42 --sensor S --out i.pcd",
            "lidarcheck ideal from-snippet a.pcd --region 4,5,0,1,0,2 --model m --out i",
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
            "lidarcheck ideal from-map hall.ply --poses p.csv --sensor XT32 --out ideals",
            "lidarcheck ideal from-map a.laz --poses p.txt --swept --model m.toml --out out",
        ),
    ),
    Command(
        "case make",
        "cases.make",
        "--measured SCANS --ideal IDEALS --model MODEL --out DIR [OPTIONS]",
        "Make a case from measured frames and a model.",
        "Frames are paired by name, number, time or order. Files are copied into DIR, which then has all that explain "
        "reads: the scans, their ideal scans, the model with the files that it names, and case.toml. Written whole or "
        "not at all; a case that is there is replaced with --force alone.",
        (
            "lidarcheck case make --measured real --ideal ideals --model m.toml --out c",
            "lidarcheck case make --measured a.mcap --ideal i.pcd --model m.toml --out c",
        ),
    ),
    Command(
        "case check",
        "cases.check",
        "CASE [OPTIONS]",
        "Say what a case's data can show.",
        "Reads the case with all its checks, and says first how many of the effects these data can show; then which "
        "cannot be shown and why, which frames fit, select and verify, whether the geometry was checked, and how far "
        "measurement and model lie apart. Exit code 0: something can be shown; 1: nothing can; 2: could not run.",
        ("lidarcheck case check case", "lidarcheck case check case --json - --quiet"),
    ),
    Command(
        "still",
        "scans.still",
        "FRAMES ... --out DIR [OPTIONS]",
        "Take the frames in which the scene stands still.",
        "Frames agree where their rays do, but for noise: noise makes neighbouring rays differ each for itself, motion "
        "moves whole surfaces. The longest run of frames in a row that agree goes to DIR, a file each. Nothing need be "
        "known of the sensor.",
        ("lidarcheck still drive.mcap --out rest", "lidarcheck still scans --out rest --most 12"),
    ),
    Command(
        "quickstart",
        "quickstart.command",
        "BAG|FOLDER|FILES --out DIR [OPTIONS]",
        "Go from a recording to a verdict.",
        "Takes the frames that stand still, finds the sensor that measured or guesses its beams, makes ideal scans and "
        "the sensor's laws from the repeats, a case of these, says what the case can show, explains it, and writes one "
        "page, report.html. Each step is a command that it prints and that you can run; given again, it goes on where "
        "it stopped. With fewer than three frames it ends after the laws.",
        ("lidarcheck quickstart rest.mcap --out first", "lidarcheck quickstart scans --sensor OS1-128 --out first"),
    ),
)
