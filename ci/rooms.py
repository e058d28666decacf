"""Writes what docs/architecture.md says of the source tree, and draws its layers. Run by ci/rooms.

The rooms' lines are the first sentences of their docstrings; the layers are those of the import contract.
"""

from __future__ import annotations

import ast
import tomllib
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "lidarcheck"
PAGE = ROOT / "docs" / "architecture.md"
PICTURE = ROOT / "docs" / "images" / "layers.svg"
BEGIN, END = "<!-- begin: written by ci/rooms -->", "<!-- end: written by ci/rooms -->"
GROUPS = {
    "api": ("what people use", "#dbe9fb"),
    "explain": ("the workflows", "#dff1e5"),
    "inference": ("what the workflows share", "#fdf0d5"),
    "model": ("the sensor model and its inputs", "#fbe3d6"),
    "scan": ("what everything stands on", "#eceef1"),
}
"""The first room of each group of layers, from above, with the group's name and colour."""
WIDTH, ROW, LEFT, NAMES = 860, 26, 210, 110
FONT = 'font-family="DejaVu Sans, Helvetica, Arial, sans-serif" font-size="12"'


def sentence(file: Path) -> str:
    """The first sentence of a module's docstring, without the full stop."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    first = " ".join(text.split("\n\n")[0].split())
    return first.split(". ")[0].removesuffix(".")


def layers() -> list[str]:
    """The rooms by the import contract, the highest first."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    return [
        room.strip()
        for layer in next(one["layers"] for one in contracts if one["type"] == "layers")
        for room in layer.removeprefix("lidarcheck.").split("|")
    ]


def docstring_of(room: str) -> str:
    """What a room says of itself, a package or a module."""
    package = SOURCE / room / "__init__.py"
    return sentence(package if package.is_file() else SOURCE / f"{room}.py")


def rooms() -> str:
    """The rooms as a Markdown table, with the folders in each."""
    rows = ["| room | what is in it |", "|---|---|"]
    for room in layers():
        package = (SOURCE / room).is_dir()
        rows.append(f"| `{room}{'/' if package else '.py'}` | {docstring_of(room)} |")
        inner = sorted((SOURCE / room).glob("*/__init__.py")) if package else []
        rows.extend(f"| &emsp;`{one.parent.name}/` | {sentence(one)} |" for one in inner)
    return "\n".join(rows)


def page() -> str:
    """docs/architecture.md with the list of today."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{rooms()}\n\n{END}{rest.partition(END)[2]}"


def short(words: str, letters: int = 92) -> str:
    """As much of a sentence as fits into a row."""
    return words if len(words) <= letters else f"{words[: letters - 2].rsplit(' ', 1)[0]} …"


def picture() -> str:
    """The layers as SVG: an import may only go down."""
    names = layers()
    height = ROW * len(names) + 34
    parts = [f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>']
    parts.append(f'<text x="12" y="20" {FONT} fill="#57606a">A room imports only what stands below it.</text>')
    colour = "#ffffff"
    for i, name in enumerate(names):
        top = 30 + ROW * i
        if name in GROUPS:
            title, colour = GROUPS[name]
            parts.append(f'<text x="12" y="{top + 17}" {FONT} fill="#57606a">{escape(title)}</text>')
        parts.append(
            f'<rect x="{LEFT}" y="{top}" width="{WIDTH - LEFT - 8}" height="{ROW - 3}" rx="3" fill="{colour}"/>'
            f'<text x="{LEFT + 8}" y="{top + 16}" {FONT} font-weight="bold" fill="#1f2328">{name}</text>'
            f'<text x="{LEFT + NAMES}" y="{top + 16}" {FONT} font-size="10.5" fill="#1f2328">'
            f"{escape(short(docstring_of(name)))}</text>"
        )
    body = "\n".join(parts).replace(f'{FONT} font-size="10.5"', FONT.replace('"12"', '"10"'))
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}"'
    return f'{head} role="img">\n<title>The layers of lidarcheck</title>\n{body}\n</svg>\n'


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    PICTURE.write_text(picture(), encoding="utf-8")
