"""Makes scans of the scenarios wrong at random, and says which of them nobody noticed; run by ci/fuzz_geometry.

    ci/fuzz_geometry                       # 500 wrongs and 500 rights over all scenarios
    ci/fuzz_geometry --wrongs 50 --seed 3  # fewer, others

Prints a table of what was said of each kind, then every wrong that passed and every right that was refused; exit code 1
where there is one, or where fewer than 95 % of the rights were judged.
"""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
JUDGED = 0.95


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wrongs", type=int, default=500)
    parser.add_argument("--rights", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="scenarios in whose name this occurs")
    args = parser.parse_args()
    sys.path.insert(0, str(ROOT / "tests" / "kits"))
    logging.getLogger("lidarcheck").setLevel(logging.ERROR)
    from geometry_fuzz import counted, trials

    paths = [path for path in sorted((ROOT / "scenarios").glob("*.toml")) if args.only in path.stem]
    found = list(trials(paths, args.wrongs, args.rights, args.seed))
    outcomes = ("refused", "warned", "doubted", "not checked", "untold", "passed")
    counts = counted(found)
    print(f"{'':24}" + "".join(f"{name:>13}" for name in outcomes))
    for kind in sorted({trial.kind for trial in found}):
        print(f"{kind:24}" + "".join(f"{counts[kind, name] or '-':>13}" for name in outcomes))
    rights = [trial for trial in found if trial.kind == "right"]
    silent = [trial for trial in found if trial.kind != "right" and trial.outcome == "passed"]
    refused = [trial for trial in rights if trial.outcome in ("refused", "warned", "doubted")]
    judged = sum(trial.outcome == "passed" for trial in rights) / max(len(rights), 1)
    for trial in (*silent, *refused):
        print(f"{trial.kind}, {trial.example}: {trial.outcome} {trial.said}")
    print(f"{len(silent)} wrongs silent, {len(refused)} rights refused or warned of, {100 * judged:.1f} % judged")
    return 1 if silent or refused or judged < JUDGED else 0


if __name__ == "__main__":
    sys.exit(main())
