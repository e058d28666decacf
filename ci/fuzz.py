"""Reads malformed files of every format that lidarcheck reads; run by ci/fuzz.

    ci/fuzz                              # 20 000 files
    ci/fuzz --count 500 --seed 3 --jobs 1
    ci/fuzz --seed 3 --only 117          # one of them again, with what was raised

A file must be read or refused in lidarcheck's own words, in 5 s and 1 GiB. What fails otherwise is kept in
`.lidarcheck/fuzz`, with the command that repeats it beside it; exit code 1 where there is one.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / ".lidarcheck/fuzz"
OUTCOMES = ("read", "refused", "traceback", "memory", "hang", "crash")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--first", type=int, default=0, help="the number of the first file")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--only", type=int, help="the number of one file")
    args = parser.parse_args()
    sys.path.insert(0, str(ROOT / "tests/kits"))
    from file_fuzz import fuzzed

    outcomes: Counter[str] = Counter()
    numbers = range(args.first, args.first + args.count) if args.only is None else [args.only]
    failed = 0
    for failure in fuzzed(args.seed, numbers, min(args.jobs, len(numbers)), outcomes):
        failed += 1
        KEPT.mkdir(parents=True, exist_ok=True)
        file = KEPT / f"{args.seed}_{failure.number}_{failure.name}"
        file.write_bytes(failure.content)
        again = f"ci/fuzz --seed {args.seed} --only {failure.number}"
        file.with_name(f"{file.name}.why").write_text(f"{again}\n{failure.how}\n{failure.words}\n")
        words = failure.words.strip().splitlines()
        print(f"{failure.how}: {file.relative_to(ROOT)}: {words[-1] if words else ''}; again: {again}", flush=True)
        if args.only is not None:
            print(failure.words)
    names = dict.fromkeys(key.split()[0] for key in sorted(outcomes))
    print(f"{'':36}" + "".join(f"{how:>11}" for how in OUTCOMES))
    for name in names:
        print(f"{name:36}" + "".join(f"{outcomes[f'{name} {how}'] or '-':>11}" for how in OUTCOMES))
    print(f"{len(numbers)} files, {failed} failures")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
