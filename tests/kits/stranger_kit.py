"""A project as a stranger may send it: a model that is a program, which leaves a mark wherever it runs."""

import re
import sys
from pathlib import Path

from scenario_texts import kpis, wall_scenario

PROGRAM = """\
import pathlib, random, sys
import helper
pathlib.Path(__file__).with_name("ran.log").open("a").write(helper.WORD + "\\n")
ideal, ini, scan = sys.argv[1:]
draw = random.Random(int(open(ini).read().split("=")[1]))
out = ["RANGE Point Layer EchoNumber WIDTH AREA PEAK"]
lines = open(ideal).read().splitlines()
names = lines[0].lstrip("/").split()
for line in lines[1:]:
    row = dict(zip(names, line.split()))
    if len(row) > 2:
        out.append(f"{row['Distance']} {row['Point']} {row['Layer']} 1 9 {draw.gauss(100, 5)} 5")
open(scan, "w").write("\\n".join(out) + "\\n")
"""
MODEL = f"""\
[external]
command = ["{sys.executable}", "-S", "../tool/post.py", "{{ideal}}", "{{ini}}", "{{scan}}"]
"""


def stranger(root: Path) -> Path:
    """The project, made."""
    for name in ("scenarios", "models", "tool"):
        (root / name).mkdir()
    (root / "tool" / "post.py").write_text(PROGRAM)
    (root / "tool" / "helper.py").write_text('WORD = "as trusted"\n')
    (root / "models" / "model.toml").write_text(MODEL)
    wall = wall_scenario((250, 252), (470, 479), 20.0, "../models/model.toml") + kpis(area_mean=2)
    (root / "scenarios" / "wall.toml").write_text(wall)
    (root / "ideal.txt").write_text("Layer Point Distance MaterialID IncidenceAngle\n250 470 20.0 1 0.0\n")
    return root


def ran(root: Path) -> list[str]:
    """What the program was when it ran, run by run."""
    mark = root / "tool" / "ran.log"
    return mark.read_text().split("\n")[:-1] if mark.exists() else []


def hash_in(said: str) -> str:
    """The hash that a refusal names."""
    [found] = set(re.findall(r"\b[0-9a-f]{64}\b", said))
    return found
