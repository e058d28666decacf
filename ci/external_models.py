"""How well `explain` names what is hidden around sensor models that are not ours. Run by ci/external_models."""

import os

from foreign_sensors import ROOT, run

CASES, SEED = 20, 1


def main() -> int:
    os.environ["LIDARCHECK_TRUST"] = "all"  # the programs are those of examples/, in this process and in its workers
    return run(ROOT / "tests/hidden/around", CASES, SEED, __doc__ or "", None)


if __name__ == "__main__":
    raise SystemExit(main())
