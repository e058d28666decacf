"""The commands of the calibration work: panels, blooming, ghosts, vehicles, scenes."""

from __future__ import annotations

from lidarcheck.cli.core.command import Command

__all__ = ["CALIBRATION_COMMANDS", "GROUPS"]

GROUPS: dict[str, str] = {
    "vehicles": "Compare vehicles, real against simulated, or merge them.",
    "scenes": "Compare whole measured frames with the model's.",
    "ghosts": "Traffic signs and their ghosts at twice the range.",
    "bloom": "Blooming: profiles real over simulated, and the fit of its tables.",
    "lut": "Blooming tables: show and edit them.",
    "sensor": "Sensor files: any lidar as data.",
    "dataset": "Data sets: what was measured, at what, in one file.",
    "ideal": "Ideal scans from measurements.",
    "case": "Cases for explain: make one, and see what it can show.",
}
"""What each group of commands is for, as `lidarcheck --help` shows it."""

CALIBRATION_COMMANDS: tuple[Command, ...] = (
    Command(
        "panels",
        "calibration.panels",
        "MEASURED ... --out DIR [OPTIONS]",
        "Characterise the sensor's noise on the panels of a laboratory.",
        "Merges the frames, trims floor and roof, finds the panels and says of each how often it is detected, how the "
        "range scatters, where the range walks with the amplitude, and how amplitudes and distances are distributed; "
        "over all panels, how that goes with the range. With --simulated, or with --model, the model stands beside the "
        "sensor. With --ideal the panels come from what the beams meet, without it from the measured points. Each "
        "panel's echoes, its four borders trimmed, are saved.",
        (
            "lidarcheck panels real_*.pcd --ideal hall.pcd --model SLIM.toml --out noise",
            "lidarcheck panels real_*.pcd --out noise --expect 16 --trim-m 0.05",
        ),
    ),
    Command(
        "vehicles compare",
        "calibration.vehicles",
        "REAL ... --vehicle KIND (--simulated SIM ... | --model MODEL --ideal IDEAL ...) [OPTIONS]",
        "Compare a vehicle at several distances, real against simulated.",
        "The vehicle is cut out of each frame: by its object in the ideal scan, by a box, or as the nearest cluster of "
        "its size above the ground. A file that holds the vehicle alone is taken whole. Prints PEAK, AREA and WIDTH "
        "distances for each distance; --out gets their histograms and distances.png with all of them.",
        (
            "lidarcheck vehicles compare a.pcd@25 --vehicle car --simulated b.pcd",
            "lidarcheck vehicles compare a.pcd --vehicle van --ideal i.txt --model M.toml",
        ),
    ),
    Command(
        "vehicles merge",
        "calibration.vehicles",
        "REAL SIMULATED --out FILE [OPTIONS]",
        "Put a real and a simulated vehicle beside each other in one file.",
        "Both are cut out, their centroids laid onto each other, and the simulated one moved to the right, so that it "
        "stands beside the real one as the sensor sees them. The column Simulated is 0 for the real points, else 1.",
        (
            "lidarcheck vehicles merge real.pcd sim.pcd --vehicle car --out both.pcd",
            "lidarcheck vehicles merge a.pcd b.pcd --out both.pcd --y -4 --plot top",
        ),
    ),
    Command(
        "scenes compare",
        "calibration.scenes",
        "MEASURED ... --ideal IDEAL ... (--model MODEL | --simulated SIM ...) [OPTIONS]",
        "Compare measured frames of a scene with the model's.",
        "Prints where the two disagree most, in plain words, the largest first; then overlap and Chamfer distance, and "
        "the KPIs of each object. What two runs of the model differ by is chance, and is not listed. --effects and "
        "--without choose what the model does.",
        (
            "lidarcheck scenes compare a.pcd --ideal i.txt --model M.toml --out found",
            "lidarcheck scenes compare a.pcd --ideal i.txt --model M.toml --without fog",
        ),
    ),
    Command(
        "gap",
        "calibration.gap",
        "PROJECT ... [OPTIONS]",
        "Say how far measurements and model are apart, and whether an edit helped.",
        "PROJECT is a directory with measurements and their ideal scans, a model and tables, or a case; scans may be "
        "named one by one, with --ideal. Prints for each measurement the misfit of the bloom beside bright targets, "
        "which tells of blooming tables, and the gap, which tells of all else, in standard deviations of one beam, "
        "with its 90 % interval and what a model that is right would leave. With --before, a model or a table as it "
        "was, says of each number whether it is better, worse or the same. With --history prints what was found with "
        "each edit in the terminal interface.",
        (
            "lidarcheck gap project --at 69 --json -",
            "lidarcheck gap project --lut edited.ini --before vertical.ini",
            "lidarcheck gap real.pcd --ideal ideal.txt --model M.toml --whole",
            "lidarcheck gap project --history",
        ),
    ),
    Command(
        "ghosts find",
        "calibration.ghosts",
        "SCAN ... [OPTIONS]",
        "Find signs and their ghosts, and leave nothing else.",
        "A ghost stands on the sign's own beams at twice its range and is fainter. Labels the echoes of signs and "
        "ghosts, counts and compares them, and writes them to --out as PCD, one file a scan. With --simulated, or "
        "--ideal and --model, beside what a model shows.",
        (
            "lidarcheck ghosts find 1_25m.txt 2_45m.txt 3_65m.txt 4_85m.txt --out ghosts",
            "lidarcheck ghosts find 1_25m.txt --ideal 1_ideal.txt --model SLIM.toml",
        ),
    ),
    Command(
        "ghosts fit",
        "calibration.ghosts",
        "SCAN ... --ideal IDEAL ... --model MODEL --out DIR [OPTIONS]",
        "Fit the ghost effect to signs and ghosts measured at several ranges.",
        "Fits strength, exponent and extra_m of retro_ghost over all datasets, with 95 % intervals, and writes the "
        "model with them to --out.",
        ("lidarcheck ghosts fit 1.txt 2.txt --ideal i1.txt i2.txt --model m.toml --out a",),
    ),
    Command(
        "calibrate",
        "calibration.calibrate",
        "CASE --free NAMES --out DIR [OPTIONS]",
        "Fit named parameters of the model to measured frames.",
        "CASE is a directory with case.toml: a model, and frames of an ideal scan, a measured scan, a time. Rounds of "
        "fitting, simulating and comparing go on until the model improves no longer on what was held out. Writes "
        "model.toml, the model's own text with the fitted numbers in their places, report.html, result.json and "
        "pictures/. An interrupted run goes on when the same command is given again.",
        (
            "lidarcheck calibrate case --free signal_at_1m,pulse_fwhm_ns --out fitted",
            "lidarcheck calibrate case --free 'materials.*.reflectance' --out fitted",
            "lidarcheck calibrate case --free effects.fog.mor_m --out fitted --seed 1",
        ),
    ),
    Command(
        "bloom fit",
        "calibration.bloom",
        "SCAN ... --model MODEL --lut LUT --out DIR [OPTIONS]",
        "Fit a blooming table to all distances together.",
        "Each SCAN shows a retro-reflecting target, or is a profile as CSV. The fitted table keeps the X of LUT and "
        "says of each row what it rests on; DIR also gets model.toml, the model that uses it.",
        (
            "lidarcheck bloom fit a.txt@69 b.txt@157 --model SLIM.toml --lut v.ini --out d",
            "lidarcheck bloom fit p.csv --free pulse --model SLIM.toml --lut v.ini --out d",
        ),
    ),
    Command(
        "bloom show",
        "calibration.bloom",
        "SCAN ... --model MODEL [OPTIONS]",
        "Show the profiles of a target's bloom.",
        "Range, PEAK, AREA and WIDTH over the offset from the target; real over simulated with --simulated or --lut.",
        ("lidarcheck bloom show real.txt --simulated sim.txt --model SLIM.toml",),
    ),
    Command(
        "bloom settings",
        "calibration.bloom",
        "FILE [OPTIONS]",
        "Show or change the settings of each distance.",
        "The file's name says direction and variant: Blooming_Calibration_V_SLIM.json. Without a file the defaults "
        "are shown; a change writes the file, and FILE.undo holds what it was.",
        (
            "lidarcheck bloom settings Blooming_Calibration_V_SLIM.json",
            "lidarcheck bloom settings Blooming_Calibration_V_SLIM.json --set 69:SegHor=440",
        ),
    ),
    Command(
        "lut show",
        "calibration.lut",
        "FILE [OPTIONS]",
        "Show blooming tables.",
        "Scaled is Y as an editor shows it: 0 for no light, 1 to 1000 for 0.0000001 to 1 in steps of 0.007 decades.",
        ("lidarcheck lut show vertical_lut.ini", "lidarcheck lut show vertical_lut.ini --json"),
    ),
    Command(
        "lut set",
        "calibration.lut",
        "FILE [OPTIONS]",
        "Set cells of a blooming table.",
        "Cells are named by row or by X, several at once; values are scaled, 0 to 1000. --x gives a row another X. "
        "What is not set keeps its bytes. FILE.undo holds the table as it was.",
        (
            "lidarcheck lut set vertical_lut.ini --row 3=512 --row 5..9=480",
            "lidarcheck lut set vertical_lut.ini --at -20=430 --at 100..140=0 --dry-run",
            "lidarcheck lut set vertical_lut.ini --x 3=-45",
            "lidarcheck lut set vertical_lut.ini --keep --out copy.ini",
        ),
    ),
    Command(
        "lut add",
        "calibration.lut",
        "FILE [OPTIONS]",
        "Add rows to a blooming table.",
        "Behind a row, X between it and the next (their geometric mean where both have one sign), or at an X in its "
        "place. Y is on the line through the rows around it in log10 Y over X, unless it is given. What is not new "
        "keeps its bytes.",
        (
            "lidarcheck lut add vertical_lut.ini --after 3",
            "lidarcheck lut add vertical_lut.ini --at -40 --at 25=512",
        ),
    ),
    Command(
        "lut remove",
        "calibration.lut",
        "FILE [OPTIONS]",
        "Take rows out of a blooming table.",
        "By --rows or --x; one must stay. What stays keeps its bytes.",
        ("lidarcheck lut remove vertical_lut.ini --x 100..140 --dry-run",),
    ),
    Command(
        "lut scale",
        "calibration.lut",
        "FILE [OPTIONS]",
        "Move cells of a blooming table up or down.",
        "By steps on the editor's scale or by a factor on Y; all rows, or those of --rows or --x. Y = 0 stays 0.",
        (
            "lidarcheck lut scale vertical_lut.ini --by 20 --rows 5..9",
            "lidarcheck lut scale vertical_lut.ini --factor 1.5 --x 20..140",
        ),
    ),
    Command(
        "lut smooth",
        "calibration.lut",
        "FILE [OPTIONS]",
        "Smooth cells of a blooming table.",
        "Each moves half of the way to the line through its neighbours, in log10 Y over X; all rows, or those "
        "of --rows "
        "or --x. Y = 0, X = 0 and the ends stay.",
        ("lidarcheck lut smooth vertical_lut.ini --x 5..60 --dry-run",),
    ),
    Command(
        "lut undo",
        "calibration.lut",
        "FILE [OPTIONS]",
        "Take the last edit of a blooming table back.",
        "FILE and FILE.undo change places, so that a second undo makes the edit again.",
        ("lidarcheck lut undo vertical_lut.ini",),
    ),
)
