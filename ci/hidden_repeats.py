"""How well `explain` names what is hidden in repeats, and leaves what they cannot show. Run by ci/repeats."""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from lidarcheck.cases.case import Case, load_case
from lidarcheck.errors import InputError
from lidarcheck.explain import workflow
from lidarcheck.explain.benchmark.run import run_benchmark
from lidarcheck.explain.benchmark.score import Answer
from lidarcheck.explain.report.explanation import Explanation

ROOT = Path(__file__).resolve().parents[1]
CASES, SEED = 30, 1
SAID = ("right", "right and more", "equivalent", "unknown", "no gap", "wrong", "error")
"""What an answer may be: of what repeats cannot show, `right` is that it is not testable and that nothing is named."""
COMMAND = "from lidarcheck.cli.core.entry import main; main()"


def explain(case: Case, *, exclude: Sequence[str] = (), jobs: int = 1) -> Explanation:
    """The case's frames beside ideal scans of their own, estimated by the command, and never beside its true ones."""
    with tempfile.TemporaryDirectory() as scratch:
        return workflow.explain(load_case(estimated(case.directory, Path(scratch))), exclude=exclude, jobs=jobs)


def estimated(recording: Path, out: Path) -> Path:
    """A case of a recording's frames in `out`, with what `ideal from-repeats` makes of them."""
    frames = sorted(recording.glob("frame_*.txt"))
    words = ["ideal", "from-repeats", *map(str, frames), "--model", str(recording / "model.toml"), "--out", str(out)]
    ended = subprocess.run([sys.executable, "-c", COMMAND, *words, "--quiet"], capture_output=True, text=True)
    if ended.returncode:
        raise InputError(ended.stderr.strip().removeprefix("error: "))
    facts = json.loads((out / "repeats.json").read_text(encoding="utf-8"))
    lines = ['model = "model.toml"', 'ideals_from = "repeats"']
    lines += [f"repeats = {min(frame['repeats'] for frame in facts['frames'])}"]
    lines += ['laws_from = "repeats"'] if facts["laws"]["fitted"] else []
    for k, (file, frame) in enumerate(zip(frames, facts["frames"], strict=True)):
        shutil.copy(file, out / file.name)
        lines += ["", "[[frames]]", f'ideal = "{frame["ideal"]}"', f'measured = "{file.name}"', f"time = {0.1 * k:.1f}"]
        lines += [f'part = "{frame["part"]}"']
    (out / "case.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return out


def said(answer: Answer) -> str:
    """What an answer is worth: one of `SAID`."""
    if answer.error:
        return "error"
    hidden = set(answer.effects)
    if answer.kind != "single":
        quiet = answer.verdict == "no_gap" and hidden <= set(answer.not_testable)
        return "right" if quiet else "unknown" if answer.verdict == "unknown" and not answer.names else "wrong"
    if answer.verdict in ("no_gap", "unknown"):
        return answer.verdict.replace("_", " ")
    if hidden <= set(answer.names):
        return "right" if answer.right else "right and more"
    return "equivalent" if hidden <= {other for one in answer.found for other in one["equivalent_to"]} else "wrong"


def tables(answers: Sequence[Answer]) -> str:
    """Markdown: answers by kind and sensor, and every case."""
    head = ("what is hidden", "sensor", "cases", *SAID, "closed, median")
    lines = [_row(head), _row(["---"] * len(head))]
    words = {"single": "what repeats show", "untestable": "what is constant", "null": "nothing"}
    for kind, of in words.items():
        mine = [one for one in answers if one.kind == kind]
        sensors = sorted({one.variant for one in mine})
        for sensor in (*sensors, "all") if mine else ():
            some = [one for one in mine if sensor in ("all", one.variant)]
            count = Counter(said(one) for one in some)
            closed = _median(one.closed for one in some if one.names)
            lines.append(_row((of, sensor, len(some), *(str(count[word] or "-") for word in SAID), closed)))
    head = ("case", "sensor", "hidden", "answer", "names", "closed", "seconds")
    lines += ["", _row(head), _row(["---"] * len(head)), *(_row(_case(one)) for one in answers)]
    return "\n".join(lines) + "\n"


def _case(one: Answer) -> tuple[object, ...]:
    names = "; ".join(" or ".join((f["name"], *f["equivalent_to"])) for f in one.found) or "-"
    closed = "-" if math.isnan(one.closed) or not one.found else f"{one.closed:.2f}"
    hidden = ", ".join(one.effects) or "nothing"
    return one.number, one.variant, hidden, said(one), one.error or names, closed, f"{one.seconds:.0f}"


def _median(values: Iterable[float]) -> str:
    known = sorted(value for value in values if not math.isnan(value))
    return f"{known[len(known) // 2]:.2f}" if known else "-"


def _row(cells: Iterable[object]) -> str:
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--only", choices=("null",), help="one kind of case")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, help="keeps each answer as soon as it is there")
    chosen = parser.parse_args(arguments)

    def on_progress(done: int, of: int, words: str) -> None:
        print(f"{done} of {of}: {words}", file=sys.stderr, flush=True)

    # The benchmark finds what answers by its module's name, in its workers too.
    os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT / "ci"), os.environ.get("PYTHONPATH", "")])
    place = ROOT / "tests/hidden/repeats"
    found = run_benchmark(
        chosen.cases, seed=chosen.seed, only=chosen.only, jobs=chosen.jobs, generator=place, out=chosen.out,
        on_progress=on_progress, explain="hidden_repeats:explain",
    )  # fmt: skip
    sys.stdout.write(tables(found.answers))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
