"""Records what lidarcheck does, and compares what it does later with the record. Run by ci/freeze.

    ci/freeze record DIR     with the code as it stands
    ci/freeze compare DIR    afterwards: what is different, by item; exit code 1 on any difference

For work that is to change nothing: only the command line and files count, whatever the modules are called. The inputs
are made once, by `record`, and lie in DIR/inputs; results in DIR/ITEM.json and DIR/compared/ITEM.json, written after
each piece, so that the same command goes on where it was interrupted.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from freeze_differences import judge
from freeze_inputs import make_inputs, write_explain_case
from freeze_items import ITEMS, Piece, pieces_of, run_piece
from freeze_tool import Tool

ROOT = Path(__file__).resolve().parents[1]
SHOWN = 12
ENDED = (130, 143)
"""Exit codes of a command that was interrupted: no result of it is kept."""
DAY_S = 86400.0


def main(argv: list[str] | None = None) -> int:
    args = _arguments(argv)
    args.directory = args.directory.resolve()
    program: Path = args.lidarcheck.absolute()
    if not program.is_file():
        sys.exit(f"{program}: there is no such program; name one with --lidarcheck")
    inputs, source = args.directory / "inputs", source_of(program, args.sources)
    tool = Tool(program, _cache(args.directory / "cache", source))
    items = [item for item in ITEMS if item in args.only]
    if args.action == "record":
        _prepare(args, items, tool, inputs)
    elif not inputs.is_dir():
        sys.exit(f"{args.directory}: there is no record; make one with: ci/freeze record {args.directory}")
    print(f"{args.action}: {program}, sources {source[:12]}", flush=True)
    return max((_item(item, args, tool, inputs, source) for item in items), default=0)


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="ci/freeze", description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("action", choices=("record", "compare"))
    parser.add_argument("directory", type=Path, help="where the record lies")
    parser.add_argument("--only", type=_items, default=ITEMS, help=f"items, with commas between: {','.join(ITEMS)}")
    parser.add_argument("--lidarcheck", type=Path, default=ROOT / ".venv/bin/lidarcheck", help="the program to run")
    parser.add_argument("--sources", type=Path, help="where its code lies, if neither beside it nor installed with it")
    parser.add_argument("--jobs", type=int, default=1, help="commands side by side, one thread each")
    parser.add_argument("--repo", type=Path, default=ROOT, help="of record: whose scenarios and tests/hidden")
    parser.add_argument("--cases", type=int, default=24, help="of explain: how many cases")
    parser.add_argument("--frames", type=int, default=3, help="of record, explain: frames a case, 3 at least")
    parser.add_argument("--seed", type=int, default=730001, help="of record, explain: seed of the cases")
    return parser.parse_args(argv)


def _items(text: str) -> tuple[str, ...]:
    names = tuple(text.split(","))
    wrong = [name for name in names if name not in ITEMS]
    if wrong:
        raise argparse.ArgumentTypeError(f"there is no {', '.join(wrong)}; there are {', '.join(ITEMS)}")
    return names


def source_of(program: Path, named: Path | None = None) -> str:
    """A hash of the code behind a program: results of two versions are never mixed."""
    places = (
        [named] if named else [program.parents[1].parent / "src", *program.parents[1].glob("lib/python*/site-packages")]
    )
    digest, found = hashlib.sha256(), False
    for base in places:
        for file in sorted(base.glob("lidarcheck/**/*")):
            if file.suffix in (".py", ".toml") and file.is_file():
                digest.update(f"{file.relative_to(base)}\0".encode() + file.read_bytes() + b"\0")
                found = True
    if not found:
        sys.exit(f"{program}: its code is not beside it; name the directory that holds lidarcheck/ with --sources")
    return digest.hexdigest()


def _cache(place: Path, source: str) -> Path:
    """The cache of this very code; those that other code has left a day ago are removed."""
    own = place / source[:16]
    own.mkdir(parents=True, exist_ok=True)
    os.utime(own)
    for other in place.iterdir():
        if other.stat().st_mtime < time.time() - DAY_S:
            shutil.rmtree(other, ignore_errors=True)
    return own


def _prepare(args: argparse.Namespace, items: list[str], tool: Tool, inputs: Path) -> None:
    """The inputs, where they are not there yet."""
    if not inputs.is_dir():
        start = time.perf_counter()
        make_inputs(args.repo.resolve(), inputs, tool)
        print(f"inputs: {time.perf_counter() - start:.0f} s", flush=True)
    if "explain" not in items:
        return
    orders = {"seed": args.seed, "frames": args.frames}
    cases, kept = inputs / "explain", inputs / "explain/orders.json"
    cases.mkdir(exist_ok=True)
    if kept.exists() and json.loads(kept.read_text(encoding="utf-8")) != orders:
        sys.exit(f"{kept}: the cases there are of another --seed or --frames; record to another directory")
    kept.write_text(json.dumps(orders), encoding="utf-8")
    for number in range(args.cases):
        case = cases / f"case_{number:02d}"
        if not case.is_dir():
            told = write_explain_case(args.repo / "tests", number, args.cases, args.seed, args.frames, case)
            print(f"{case.name}: {told['kind']}, {' and '.join(told['hidden']) or 'nothing'} hidden", flush=True)


def _item(item: str, args: argparse.Namespace, tool: Tool, inputs: Path, source: str) -> int:
    """Record an item, or run it again and compare: 1 where something is different."""
    record, compared = args.directory / f"{item}.json", args.directory / "compared" / f"{item}.json"
    pieces = pieces_of(item, inputs, tool, args.jobs)
    if item == "explain":
        pieces = pieces[: args.cases]
    if args.action == "record":
        kept = _kept(record, source)
        if kept is None:
            sys.exit(f"{record}: is of other sources; record to another directory")
        _run(item, pieces, kept, record, args, tool)
        return 0
    if not record.is_file():
        print(f"{item}: not recorded", flush=True)
        return 0
    old = json.loads(record.read_text(encoding="utf-8"))
    pieces = [piece for piece in pieces if piece.name in old["pieces"] or old["complete"]]
    compared.parent.mkdir(exist_ok=True)
    new = _run(item, pieces, _kept(compared, source) or _fresh(source), compared, args, tool)
    return _report(item, old, new, {piece.name for piece in pieces}, args)


def _fresh(source: str) -> dict[str, Any]:
    return {"of": source, "complete": False, "pieces": {}}


def _kept(file: Path, source: str) -> dict[str, Any] | None:
    """What an interrupted run has left; None where it is of other sources."""
    if not file.is_file():
        return _fresh(source)
    kept: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return kept if kept["of"] == source else None


def _run(
    item: str, pieces: list[Piece], kept: dict[str, Any], file: Path, args: argparse.Namespace, tool: Tool
) -> dict[str, Any]:
    """Run the pieces that are not there yet; what is done is written after each."""
    rest = [piece for piece in pieces if piece.name not in kept["pieces"]]
    inputs = args.directory / "inputs"
    start = time.perf_counter()
    for number, (piece, seconds, result) in enumerate(_results(rest, inputs, tool, item, args.jobs), start=1):
        if any(code < 0 or code in ENDED for code in result["codes"]):
            sys.exit(f"{item}/{piece.name}: was ended from outside; the same command goes on from here")
        kept["pieces"][piece.name] = {"seconds": round(seconds, 1), "result": result}
        if not result["codes"] or (any(result["codes"]) and not piece.name.startswith("error of ")):
            print(f"  {piece.name}: ended with {result['codes']}: {' '.join(result['err'][-1])[:300]}", flush=True)
        kept["complete"] = number == len(rest) and args.action == "record"
        _write(file, kept)
        if item == "explain" or number % 20 == 0:
            print(
                f"  {item} {number} of {len(rest)}: {piece.name}, {seconds:.1f} s of processor{_found(result)}",
                flush=True,
            )
    if rest:
        print(f"{item}: {len(rest)} pieces in {time.perf_counter() - start:.0f} s", flush=True)
    return kept


def _results(
    pieces: list[Piece], inputs: Path, tool: Tool, item: str, jobs: int
) -> Iterator[tuple[Piece, float, dict[str, Any]]]:
    """Pieces with their processor seconds and results as they end."""

    def one(piece: Piece) -> tuple[Piece, float, dict[str, Any]]:
        return piece, *run_piece(piece, inputs, tool)

    with ThreadPoolExecutor(1 if item == "goldens" else jobs) as pool:
        waiting = [pool.submit(one, piece) for piece in pieces]
        try:
            for future in as_completed(waiting):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _found(result: dict[str, Any]) -> str:
    """The answer of explain in a few words."""
    report = result["json"].get("out/report.json")
    return f": {report['verdict']} {', '.join(e['name'] for e in report['effects'])}".rstrip() if report else ""


def _write(file: Path, content: dict[str, Any]) -> None:
    draft = file.with_name(f"{file.name}.draft")
    draft.write_text(json.dumps(content), encoding="utf-8")
    draft.replace(file)


def _report(item: str, old: dict[str, Any], new: dict[str, Any], now: set[str], args: argparse.Namespace) -> int:
    """Say what is different; near is what lies within a tenth of its interval, and does not count."""
    wanted = {name for name in old["pieces"] if item != "explain" or int(name[-2:]) < args.cases}
    counts = {"same": 0, "near": 0, "different": 0}
    times = [0.0, 0.0]
    for name in sorted(now | wanted):
        if name not in now or name not in old["pieces"]:
            counts["different"] += 1
            print(f"  {item}/{name}: {'is new' if name in now else 'is gone'}")
            continue
        before, after = old["pieces"][name], new["pieces"][name]
        times = [times[0] + before["seconds"], times[1] + after["seconds"]]
        level, lines = judge(item, before["result"], after["result"])
        counts[level] += 1
        if lines:
            print(f"  {item}/{name}: {level}")
            print("".join(f"    {line}\n" for line in lines[:SHOWN]), end="")
            if len(lines) > SHOWN:
                print(f"    and {len(lines) - SHOWN} more")
    words = ", ".join(f"{count} {level}" for level, count in counts.items() if count or level == "same")
    part = "" if old["complete"] else "; the record is not complete"
    print(f"{item}: {words}; {times[0]:.0f} s of processor then, {times[1]:.0f} s now{part}", flush=True)
    return int(counts["different"] > 0)


if __name__ == "__main__":
    sys.exit(main())
