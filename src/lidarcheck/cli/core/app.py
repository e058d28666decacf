"""The commands: name, help and example of each. Their code is loaded when one of them is used."""

from __future__ import annotations

import sys
from typing import Any

from cyclopts import App

from lidarcheck import __version__
from lidarcheck.cli.core.calibration_commands import CALIBRATION_COMMANDS, GROUPS
from lidarcheck.cli.core.command import Command
from lidarcheck.cli.core.recording_commands import RECORDING_COMMANDS
from lidarcheck.cli.core.sensor_commands import SENSOR_COMMANDS
from lidarcheck.formats.field.choice import Choice, choose
from lidarcheck.permissions import grant

__all__ = ["COMMANDS", "Command", "make_app"]


COMMANDS = (
    Command(
        "simulate",
        "simulation.simulate",
        "IDEAL [IDEAL ...] --model MODEL --out SCAN [OPTIONS]",
        "Run ideal scans through the sensor model.",
        "The ideal scan says what each beam meets, the model what sensor looks. The suffix of --out names the format. "
        "The same seed gives the same bytes, on any number of cores and machines. Several ideal scans, or --frames N, "
        "give many frames: --out is then a directory, with a file each; given again, the command makes those that are "
        "not there yet.",
        (
            "lidarcheck simulate ideal.txt --model SLIM.toml --out scan.pcd --seed 7",
            "lidarcheck simulate ideal.txt --model SLIM.toml --frames 1000 --out frames",
            "lidarcheck simulate drive/*.pcd --model SLIM.toml --out frames",
        ),
    ),
    Command(
        "scene",
        "simulation.scene",
        "SCENE --out IDEAL [OPTIONS]",
        "Cast the beams into a scene and write what each meets.",
        "SCENE is a scene's TOML file, a scenario with a scene, or the name of a built-in scene; --list shows those. "
        "The suffix of --out names the format.",
        (
            "lidarcheck scene --list",
            "lidarcheck scene highway --out highway.parquet",
            "lidarcheck scene highway --sensor OS1-128 --out highway.txt",
        ),
    ),
    Command(
        "compare",
        "scans.compare",
        "MEASURED SIMULATED [OPTIONS]",
        "Compare a measured scan with a simulated one.",
        "Prints the KPIs: distances of range residual, PEAK, AREA and WIDTH, detection, walk, overlap. With the ideal "
        "scan also those that need to know which beams meet a surface. Of many frames, paired by name or number, the "
        "median and the spread of each KPI. Beside each stands what chance gives: the 95th percentile when the two "
        "sides are exchanged at random, by blocks of columns or by frames; the last line says which KPIs stand out "
        "from that. Exit code 0: done; 1: a --fail-on is met; 2: could not run.",
        (
            "lidarcheck compare real.txt sim.pcd --ideal ideal.txt --json kpis.json",
            "lidarcheck compare drive.pcd frames --ideal ideals --fail-on any --out out",
        ),
    ),
    Command(
        "explain",
        "explain.command",
        "CASE --out DIR [OPTIONS]",
        "Name the effect that a model lacks, and add it.",
        "Says where model and measurement disagree, and why. CASE is a directory with case.toml: a model, and frames "
        "of an ideal scan, a measured scan and a time. Writes report.json, report.html and model.toml, the model with "
        "what was found in it, ready for simulate and check. The verdict is no_gap, explained or unknown; the exit "
        "code is 0 for each. An interrupted run goes on when the same command is given again. --benchmark N instead "
        "runs N cases in which an effect is hidden, and says how often it is found.",
        (
            "lidarcheck explain case --out found --seed 1",
            "lidarcheck explain case --out found --exclude fog --into would_have_caught",
            "lidarcheck explain --benchmark 20 --jobs 4 --json benchmark.json",
        ),
    ),
    Command(
        "check",
        "harness.check",
        "[SCENARIO ...] [OPTIONS]",
        "Run scenarios against their goldens.",
        "Exit code 0: every KPI holds; 1: one fell out; 2: could not run.",
        ("lidarcheck check", "lidarcheck check background_SMART --seed 3 --html check.html"),
    ),
    Command(
        "review",
        "harness.review",
        "[SCENARIO ...] [OPTIONS]",
        "Show what is proposed for the goldens, and accept it.",
        "Without --accept no golden changes. What speaks against accepting, as a regression, must be answered with "
        "--reason, and the golden keeps it.",
        ("lidarcheck review", 'lidarcheck review background_SMART --accept all --reason "new SPAD"'),
    ),
    *CALIBRATION_COMMANDS,
    *SENSOR_COMMANDS,
    *RECORDING_COMMANDS,
    Command(
        "report",
        "harness.report",
        "DIR ... --out PAGE [OPTIONS]",
        "Put what all workflows have found, and the goldens, on one page.",
        "Collects every result.json with its report.html in the directories, and the state of the goldens: how each "
        "was made, what has moved since the last release, what the last check says. A workflow without a result is "
        "named as missing.",
        (
            "lidarcheck check --json results/check.json",
            "lidarcheck report results --out release.html --json release.json",
        ),
    ),
    Command(
        "convert",
        "scans.convert",
        "A B [OPTIONS]",
        "Convert a scan or an ideal scan to another format.",
        "The input is recognised by its content, the output's format follows its suffix. Unknown columns are kept. "
        "Frames of a bag (FILE#TOPIC), a trace, a folder or a data set are read one by one and written to .mcap or "
        ".bag (PointCloud2), .osi, .csv or .txt; FILE#TOPIC@NUMBER is one of them.",
        (
            "lidarcheck convert scan.txt scan.laz",
            "lidarcheck convert drive.mcap#/points drive.csv",
            "lidarcheck convert frames drive.mcap",
        ),
    ),
    Command(
        "dataset scan",
        "dataset.scan",
        "DIR [OPTIONS]",
        "Write a data set's file from the names in a folder.",
        "Distances, classes and repeats are told from names such as sign_25m_r2.pcd, ideal scans by `ideal` or "
        "`postpro` in theirs; each frame of a bag is a frame of its own. Correct dataset.toml by hand: every command "
        "that takes a scan takes it, with the pose, unit and calibration that it declares of each frame.",
        (
            "lidarcheck dataset scan measured --sensor HDL-32E",
            "lidarcheck compare dataset.toml simulated --ideal dataset.toml",
        ),
    ),
    Command(
        "split",
        "scans.split",
        "MERGED --out DIR [OPTIONS]",
        "Split a file of several frames into a file a frame.",
        "Frames are told apart by a column Frame (frame_id, FrameNumber), else by the times, else by the order of the "
        "rows, where each beam's echoes come again; --by says which of these, or names another column. Ideal scans are "
        "split by such a column alone. Every row goes to one file with all its columns, in the format of MERGED or of "
        "--format; files are named after MERGED and the frame's number. All are written or none, and none is replaced.",
        (
            "lidarcheck split drive.pcd --out frames",
            "lidarcheck split drive.csv --out frames --by sweep --format parquet",
        ),
    ),
    Command(
        "info",
        "scans.info",
        "FILE [OPTIONS]",
        "Say what a file is and what is in it.",
        "Format, rows, columns with their ranges, and what was defaulted; of bags, folders and data sets over all "
        "frames, which are read one by one.",
        ("lidarcheck info scan.pcd", "lidarcheck info drive.mcap#/points"),
    ),
    Command(
        "effects",
        "simulation.effects",
        "[NAME] [OPTIONS]",
        "List the effects that a model can name, or explain one.",
        "With a name: its parameters with unit, range and default, its formula and its source, and a plot of what it "
        "changes.",
        ("lidarcheck effects", "lidarcheck effects fog", "lidarcheck effects layer_gain --set gain=0.5"),
    ),
    Command(
        "tui",
        "tui",
        "[PROJECT] [OPTIONS]",
        "Open the terminal interface.",
        "PROJECT is a directory with scenarios, goldens, models, blooming tables, settings and measurements. Scenarios "
        "are run and looked at, tables are edited beside what they make of the measurements. ? helps, q "
        "leaves; an edit "
        "survives a lost connection.",
        ("lidarcheck tui", "lidarcheck tui bench --screen blooming --theme plain --no-mouse"),
    ),
    Command(
        "bench",
        "bench.command",
        "[OPTIONS]",
        "Measure the speed on this machine.",
        "Each figure stands beside what a user would otherwise take, measured in the same run.",
        ("lidarcheck bench", "lidarcheck bench --quick --json"),
    ),
)


class _App(App):
    """The parser; what the user permits and chooses holds as soon as it is read, whatever the command then does."""

    def parse_args(self, *args: Any, **kwargs: Any) -> Any:
        """The command's function and its arguments."""
        found = super().parse_args(*args, **kwargs)
        choose(Choice())
        for value in found[1].arguments.values():
            if hasattr(value, "permissions"):
                grant(value.permissions())
            if hasattr(value, "choice"):
                choose(value.choice())
        return found


def make_app() -> App:
    """The parser, with every command known by name and none loaded."""
    plain = not sys.stdout.isatty()
    if plain:
        from lidarcheck.cli.core.help_text import HelpText
    app = _App(
        name="lidarcheck",
        version=__version__,
        help="Calibrates and validates a LiDAR sensor model against measurements.",
        help_epilogue="Every command has its own help with an example: lidarcheck simulate --help",
        help_format="plaintext",
        help_formatter=HelpText() if plain else "default",
        suppress_keyboard_interrupt=False,
    )
    groups: dict[str, App] = {}
    for rank, command in enumerate(COMMANDS):
        if command.group and command.group not in groups:
            groups[command.group] = App(name=command.group, help=GROUPS[command.group], sort_key=rank)
            app.command(groups[command.group])
        groups.get(command.group, app).command(
            command.code,
            name=command.verb,
            help=f"{command.summary}\n\n{command.more}",
            help_epilogue="\n".join(("Example:", *(f"  {line}" for line in command.examples))),
            usage=f"Usage: lidarcheck {command.name} {command.arguments}",
            sort_key=rank,
        )
    app.command(
        "lidarcheck.cli.core.completion:install_completion",
        name="--install-completion",
        help="Install completion for bash, zsh or fish.",
    )
    return app
