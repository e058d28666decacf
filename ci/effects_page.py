"""Writes docs/effects.md: the catalogue of effects as a page. Run by ci/effects_page."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path

from lidarcheck.cli.simulation.effects_text import TREE, example, node_names
from lidarcheck.effects import Effect, catalogue
from lidarcheck.effects.search import search_spec
from lidarcheck.formats.atomic import write_text

PAGE = Path(__file__).resolve().parents[1] / "docs" / "effects.md"

HEAD = """\
# Effects

<!-- Written by ci/effects_page from src/lidarcheck/effects; change an effect's docstring there, not this page. -->

What a real sensor does beyond the reference sensor of [sensor-model.md](sensor-model.md). A model names the effects it
has; without any it is the reference sensor. `lidarcheck effects NAME` says what stands here about one of them, and
shows in the terminal what it changes on a small demonstration scene: `--set` tries other values, `--variant` the other
sensor.

The light's way has four stages: `aim` (what a beam meets), `light` (pulses and background), `detector` (the SPADs'
numbers) and `readout` (echoes). An effect belongs to one of them, and a model lists its effects in this order. At zero
strength an effect changes nothing at all. Random numbers are keyed by seed, effect, frame and beam: taking one effect
out leaves every draw of the others as it was.

An effect works on the beams of any sensor, and on the detectors that the table names. Some need more of the sensor, as
a second return; a model with an effect that means nothing for its sensor is refused with the reason, and so is a layer
or a point that the sensor does not have. An amplitude in an effect's law is what the detector counts: AREA of a SPAD
array, the amplitude of a linear detector before calibration and rounding, the photons of a histogram's echo.

"""

USE = """\
## Switching one on

An `[[effects]]` table in the model file, with its name and the parameters that are to differ from their typical values:

```toml
variant = "SMART"

{example}```

A parameter that is left out has its typical value. `noticeable` is the change of it that its user would notice, by a
rule for each [kind of quantity](research/sensitivity.md); `lidarcheck check --sensitivity` makes each of these changes
in turn. A value out of range, an unknown name, or an effect in the wrong place of the light's way is refused with the
line it stands in. Paths of files are relative to the model file. See [model-files.md](model-files.md).

## Adding one

Put a file into `src/lidarcheck/effects/`. Nothing else has to know it: the model, `lidarcheck effects` with its plot,
and this page find it there. [new-effect.md](new-effect.md) goes from the equation to the golden, with what a search
must know, and as a plugin of your own.

1. A frozen dataclass that derives from `AimEffect`, `LightEffect`, `DetectorEffect` or `ReadoutEffect` of
   `effects/base.py`, with a `name`, and in `tree` the nodes of the effect tree, if it has any.
2. Its parameters as fields, each `parameter(unit, low=, high=, typical=, noticeable=, meaning=)`; a table from a file
   is `file_parameter(kind, meaning=)`. The typical value is the default, and should show the effect clearly.
3. A docstring: what it does to the data in the first line; then formula, source, valid range, and where it is the
   identity.
4. The one method of its stage, which takes the stage's table and returns a new one, and the very same one at zero
   strength. Random numbers come from `around.uniforms` alone.
5. Its parameters at zero strength in the table of `tests/effects/test_catalogue.py`, tests of what it does, and
   `./ci/effects_page`.

## The effect tree

{tree}

"""

NODES = """\
Sensor people name causes and effects by the nodes of the perception-sensor effect tree PerCollECT/LidarLimbs (MIT
licence). The numbers here are those nodes: {nodes}. Several effects can belong to one node, and one effect to several.
The tree has no node for {without}."""

STAGES = {
    "aim": "What the beams meet",
    "light": "The light that reaches them",
    "detector": "The SPADs",
    "readout": "The echoes",
}


def page(effects: Mapping[str, type[Effect]]) -> str:
    """The whole page."""
    index = [
        f"| [`{e.name}`](#{e.name}) | {e.stage} | {kinds(e)} | {tree(e)} | {prose(e.summary())} |"
        for e in effects.values()
    ]
    used = sorted({node for effect in effects.values() for node in effect.tree})
    without = ", ".join(f"`{effect.name}`" for effect in effects.values() if not effect.tree)
    nodes = NODES.format(nodes=", ".join(named(node) for node in used), without=without)
    sample = min(effects.values(), key=lambda effect: len(effect.parameters()))
    parts = [
        HEAD,
        "| effect | stage | detectors | effect tree | what it does to the data |\n|---|---|---|---|---|\n",
        "".join(f"{line}\n" for line in index) + "\n",
        USE.format(example=example(sample), tree=textwrap.fill(nodes, 120, break_on_hyphens=False)),
    ]
    for stage, members in groupby(effects.values(), key=lambda effect: effect.stage):
        parts.append(f"## Stage {stage}: {STAGES[stage][:1].lower()}{STAGES[stage][1:]}\n\n")
        parts += [section(effect) for effect in members]
    return "".join(parts).rstrip("\n") + "\n"


def section(effect: type[Effect]) -> str:
    """One effect: docstring, parameters, and how a model asks for it."""
    text = [f"### {effect.name}\n\n{prose(inspect.getdoc(effect) or '')}\n\nEffect tree: {node_names(effect)}.\n\n"]
    text.append(
        "".join(f"Not for the detector `{kind}`: {prose(reason)}.\n\n" for kind, reason in effect.unfit.items())
    )
    if words := effect.around_program():
        text.append(f"Around [somebody else's program](model-files.md#effects-around-it): {prose(words)}.\n\n")
    rows = [
        f"| `{p.name}` | {cell(p.unit)} | {p.low:g} ... {p.highest} | {p.typical:g} | {p.noticeable:g} | "
        f"{cell(p.meaning)} |"
        for p in effect.parameters()
    ]
    rows += [
        f"| `{f.name}` | file | `{f.kind}` | none | {100.0 * f.noticeable:g} % | {cell(f.meaning)} |"
        for f in effect.files()
    ]
    if rows:
        text.append("| parameter | unit | range | typical | noticeable | meaning |\n|---|---|---|---|---|---|\n")
        text.append("".join(f"{row}\n" for row in rows) + "\n")
    return "".join([*text, f"```toml\n{example(effect)}```\n\n", *seen(effect)])


def seen(effect: type[Effect]) -> list[str]:
    """What watches one effect, and the picture that proves it."""
    spec = search_spec(effect.name)
    kinds = ", ".join(f"`{kind}`" for kind in spec.watched_by)
    found = [f"Watched by the KPIs {kinds}."] if kinds else []
    if spec.shown_by:
        feature, over = spec.shown_by
        feature = {"others": "other echoes", "detected": "detection"}.get(feature, feature)
        words = {"map": f"the map of {feature}", "histogram": f"the histogram of {feature}"}
        found.append(f"In a report of a gap it shows in {words.get(over, f'{feature} over {over}')}.")
    return [" ".join(found) + "\n\n"] if found else []


def prose(text: str) -> str:
    """Plain text as Markdown: what is neither code nor an indented formula keeps its asterisks and brackets."""
    lines = (line if line.startswith("    ") else escaped(line) for line in text.splitlines())
    return "\n".join(lines)


def escaped(line: str) -> str:
    pieces = re.split(r"(`[^`]*`)", line)
    return "".join(piece if piece.startswith("`") else re.sub(r"([*<|~])", r"\\\1", piece) for piece in pieces)


def cell(text: str) -> str:
    return escaped(text).replace("\n", " ")


def kinds(effect: type[Effect]) -> str:
    """The detectors for which it means something."""
    return "all" if not effect.unfit else ", ".join(f"`{kind}`" for kind in effect.detectors())


def tree(effect: type[Effect]) -> str:
    return ", ".join(str(node) for node in effect.tree) or "-"


def named(node: int) -> str:
    return f"{node} {TREE[node]}" if node in TREE else str(node)


if __name__ == "__main__":
    write_text(PAGE, page(catalogue()))
