"""Runs lidarcheck in a pseudo-terminal and keeps what a person sees as SVG."""

from __future__ import annotations

import io
import os
import pty
import re
import shutil
import struct
import subprocess
import sys
import tempfile
from fcntl import ioctl
from pathlib import Path
from termios import TIOCSWINSZ

from rich._export_format import CONSOLE_SVG_FORMAT
from rich.console import Console
from rich.text import Text

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
COLUMNS, LINES = 104, 40
# No web fonts: a picture in a repository fetches nothing.
FRAME = re.sub(r"@font-face \{\{.*?\}\}\s*", "", CONSOLE_SVG_FORMAT, flags=re.S)


def seen(command: list[str], directory: Path) -> str:
    """What the command writes to a terminal, progress bars wiped as they are there."""
    main, side = pty.openpty()
    ioctl(side, TIOCSWINSZ, struct.pack("HHHH", LINES, COLUMNS, 0, 0))
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": str(COLUMNS), "COLORTERM": "truecolor"}
    program = str(ROOT / ".venv" / "bin" / command[0])
    # Progress goes to standard error, which is not shown.
    process = subprocess.Popen(
        [program, *command[1:]], cwd=directory, stdout=side, stderr=subprocess.PIPE, env=environment, text=True
    )
    os.close(side)
    output = b""
    while True:
        try:
            part = os.read(main, 65536)
        except OSError:
            break
        if not part:
            break
        output += part
    problems = process.stderr.read() if process.stderr else ""
    if process.wait() not in (0, 1):
        sys.exit(problems)
    return output.decode().replace("\r\n", "\n")


def picture(name: str, shown: str, text: str) -> None:
    """Keep the text as docs/images/NAME.svg, with the command above it."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), force_terminal=True)
    console.print(Text(f"$ {shown}", style="bold"))
    console.print(Text.from_ansi(text), soft_wrap=False)
    IMAGES.mkdir(parents=True, exist_ok=True)
    svg = console.export_svg(title="lidarcheck", code_format=FRAME, unique_id=name)
    (IMAGES / f"{name}.svg").write_text(svg, encoding="utf-8")


def main() -> None:
    """A model whose signal was raised by 3 %, checked against the goldens."""
    with tempfile.TemporaryDirectory() as scratch:
        project = Path(scratch)
        for part in ("scenarios", "goldens"):
            shutil.copytree(ROOT / part, project / part)
        model = project / "scenarios" / "models" / "SMART.toml"
        text = model.read_text(encoding="utf-8")
        model.write_text(
            text.replace("[materials", "[sensor]\nsignal_at_1m = 6180.0\n\n[materials", 1), encoding="utf-8"
        )
        command = ["lidarcheck", "check", "weak_targets_SMART"]
        picture("check", "lidarcheck check weak_targets_SMART    # signal_at_1m raised by 3 %", seen(command, project))


if __name__ == "__main__":
    main()
