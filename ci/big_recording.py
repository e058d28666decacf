"""What a long recording takes: most memory and time of `info` and `convert`, of a large bag and a small one.

Each bag has one topic of clouds of 100 000 points, 10 a second; memory that hangs on its length would be ten times as
much for one as for the other. Run by ci/big_recording.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/kits"))

from bag_kit import CLOUD, PERIOD_NS, START_NS, Message, cdr_cloud, write_ros2  # noqa: E402

POINTS = 100_000
COMMAND = "from lidarcheck.cli.core.entry import main; raise SystemExit(main())"


def main() -> int:
    sizes_gb = [float(word) for word in sys.argv[1:3]] or [5.0]
    sizes_gb += [0.1 * sizes_gb[0]] * (len(sizes_gb) < 2)
    print("| command | recording [GB] | frames | most memory [MB] | clock [s] |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        for size_gb in sizes_gb:
            bag = Path(scratch) / "bag"
            frames = write(bag, size_gb)
            for words in (["info", str(bag)], ["convert", str(bag), str(Path(scratch) / "out.bag")]):
                memory_mb, seconds = measured([*words, "--quiet"])
                print(f"| `{words[0]}` | {size_gb:g} | {frames} | {memory_mb:.0f} | {seconds:.0f} |", flush=True)
            for file in (*bag.iterdir(), Path(scratch) / "out.bag"):
                file.unlink()
            bag.rmdir()
    return 0


def write(bag: Path, size_gb: float) -> int:
    """Write a bag of about so many GB; its number of frames."""
    draw = np.random.default_rng(0)
    columns = {axis: draw.uniform(1.0, 40.0, POINTS).astype("f4") for axis in "xyz"}
    columns |= {"intensity": draw.uniform(0.0, 255.0, POINTS).astype("f4")}
    columns |= {"ring": (np.arange(POINTS) % 32).astype("u2"), "time": np.linspace(-0.1, 0.0, POINTS).astype("f4")}
    cloud = cdr_cloud(columns)
    frames = max(int(size_gb * 1e9 / len(cloud)), 1)
    write_ros2(bag, (Message("/points", CLOUD, START_NS + k * PERIOD_NS, cloud) for k in range(frames)))
    return frames


def measured(words: list[str]) -> tuple[float, float]:
    """(most memory [MB], seconds) of a command."""
    start = time.monotonic()
    child = subprocess.Popen([sys.executable, "-c", COMMAND, *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    if status:
        sys.exit(f"error: lidarcheck {' '.join(words)} ended with {os.waitstatus_to_exitcode(status)}")
    return used.ru_maxrss / 1e3, time.monotonic() - start


if __name__ == "__main__":
    sys.exit(main())
