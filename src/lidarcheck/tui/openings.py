"""What the chooser offers: the project's files, what can be chosen of them, and what screens and actions add."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.choice import Part
from lidarcheck.session.pairing import measured_in, numbers_in
from lidarcheck.session.project import Entry
from lidarcheck.tui.actions import key_name
from lidarcheck.tui.chooser import Opening
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.lines import Line, line

if TYPE_CHECKING:
    from lidarcheck.tui.everywhere import Everywhere

__all__ = ["openings"]

_LISTED = {"scenario": "overview", "case": "explain", "golden": "goldens"}
"""On which screen a kind of file has its line."""
_LOOKED_AT = ("ideal", "scene", "recording")
_MOST_LINES, _MOST_BYTES = 200, 20_000


def openings(app: Everywhere) -> list[Opening]:
    """Everything, what was measured first."""
    actions = [
        Opening("action", action.name, " ".join(map(key_name, action.keys)), _doing(app, action), action.help)
        for action in app.able()
        if action.method
    ]
    added = [one for view in app.views() for one in view.openings()]
    return [*_measured(app), *_models(app), *_files(app), *_features(app), *added, *actions]


def _doing(app: Everywhere, action: object) -> Callable[[], object]:
    return lambda: app.do(action)  # type: ignore[arg-type]


def _choosing(app: Everywhere, part: Part, value: str) -> Callable[[], object]:
    def choose() -> None:
        app.choice.choose(part, value)
        app.say(f"{part}: {value}")

    return choose


def _measured(app: Everywhere) -> Iterator[Opening]:
    from lidarcheck.calibration.vehicles.kinds import distance_in_name

    profiles = sorted(app.project.of("profile"), key=lambda entry: numbers_in(entry.name))
    for entry in [*measured_in(app.project), *profiles]:
        distance = distance_in_name(entry.path)
        words = f"{'' if distance is None else f'{distance:g} m '}{entry.kind}"
        yield Opening("measured", entry.name, words, _choosing(app, "measurement", entry.name), _about(entry))


def _models(app: Everywhere) -> Iterator[Opening]:
    for entry in app.project.of("model"):
        now = "chosen" if entry.name == app.choice.of("model") else ""
        yield Opening("model", entry.name, now, _choosing(app, "model", entry.name), _about(entry))


def _features(app: Everywhere) -> Iterator[Opening]:
    for feature in app.choice.features:
        now = "chosen" if feature == app.choice.of("feature") else ""
        about = "the quantity of echoes that is looked at"
        yield Opening("feature", feature, now, _choosing(app, "feature", feature), about)


def _files(app: Everywhere) -> Iterator[Opening]:
    for kind in (*_LISTED, *_LOOKED_AT):
        opens = _listing if kind in _LISTED else _looking
        for entry in app.project.of(kind, sound=False):
            fault = "has a fault" if entry.fault else ""
            yield Opening(kind, entry.name, fault, opens(app, entry), entry.fault or _about(entry))


def _listing(app: Everywhere, entry: Entry) -> Callable[[], object]:
    """Go to the screen that lists it, with the cursor on it."""

    def go() -> None:
        screen = _LISTED[entry.kind]
        app.state.selected[screen] = entry.path.stem if entry.kind == "golden" else entry.name
        app.show_screen(screen)
        app.view.project_changed()

    return go


def _looking(app: Everywhere, entry: Entry) -> Callable[[], object]:
    """Show how the file begins."""
    return lambda: app.ask(Ask(entry.name, _begins(entry.path), {}))


def _begins(path: Path) -> Sequence[Line]:
    try:
        with path.open("rb") as file:
            head = file.read(_MOST_BYTES)
        text = head.decode("utf-8")
    except UnicodeDecodeError:
        return [line("not a text; lidarcheck info says what is in it", "dim")]
    except (OSError, LidarcheckError) as error:
        return [line(str(error), "bad")]
    return [line(one) for one in text.splitlines()[:_MOST_LINES]]


def _about(entry: Entry) -> str:
    """What a file is, as far as that is known without reading it."""
    try:
        size = entry.path.stat().st_size
    except OSError as error:
        return f"{entry.kind}: {error.strerror}"
    return f"{entry.kind}, {size / 1e6:.1f} MB" if size >= 1e5 else f"{entry.kind}, {size / 1e3:.1f} kB"
