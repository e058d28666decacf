"""Figures of workflows: as text, SVG, PNG and on a page."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

import lidarcheck
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.axes import KINDS, VIEWS, subplots_of
from lidarcheck.figures.data import Cloud, Course, Curve, Distribution, Grid, Page, Section, Table
from lidarcheck.figures.files.pictures import save_figure
from lidarcheck.figures.html.page import page_html
from lidarcheck.figures.svg import figure_svg
from lidarcheck.figures.terminal import figure_text

RNG = np.random.default_rng(7)
X = np.linspace(10.0, 200.0, 20)
RESIDUAL = Distribution("Range", "residual", "m", {"real": RNG.normal(0, 1, 500), "simulated": RNG.normal(0, 2, 500)})
AREA = Distribution("AREA", "AREA", "", {"real": RNG.lognormal(5, 1, 500), "simulated": np.zeros(3)}, log_x=True)
DETECTED = Course("Detected", "range [m]", "share", (Curve("real", X, X, X - 9, X + 9), Curve("simulated", X, X + 5)))
PROFILE = Course("Profile", "offset", "AREA", (Curve("real", X, 10 ** (-X / 40)),), log_x=True, log_y=True)
CAR = Cloud("Car", {"target": RNG.normal([40, 0, 0], 1, (900, 3)), "ghost": RNG.normal([80, 0, 0], 1, (30, 3))})
MAP = Grid("Loss", "yaw", "pitch", np.arange(5.0), np.arange(4.0), np.arange(20.0).reshape(4, 5), "loss [%]")
DIFFERENCE = Grid("Moved", "yaw", "pitch", np.arange(5.0), np.arange(4.0), np.arange(-9.0, 11).reshape(4, 5), "m", True)
NOTHING = (
    Distribution("d", "x", "m", {}),
    Distribution("d", "x", "m", {"real": np.array([np.nan]), "simulated": np.empty(0)}),
    Distribution("d", "x", "m", {"real": np.array([-1.0, 0.0])}, log_x=True),
    Course("c", "x", "y", ()),
    Course("c", "x", "y", (Curve("real", X, np.full(20, np.nan)),)),
    Cloud("c", {"real": np.empty((0, 3))}),
    Grid("g", "x", "y", np.arange(2.0), np.arange(2.0), np.full((2, 2), np.nan)),
)
FIGURES = (RESIDUAL, AREA, DETECTED, PROFILE, CAR, MAP, DIFFERENCE)


def svgs(text):
    return [ElementTree.fromstring(one) for one in re.findall(r"<svg.*?</svg>", text, re.DOTALL)]


@pytest.mark.parametrize("kind", [*KINDS, *VIEWS])
@pytest.mark.parametrize("figure", [*FIGURES, *NOTHING])
def test_every_figure_has_a_text_of_the_size_asked_for(figure, kind):
    for width, height in ((40, 9), (80, 15), (160, 50)):
        text = figure_text(figure, kind=kind, width=width, height=height, plain=True)
        lines = text.splitlines()
        assert text.isascii()
        assert len(lines) == height
        assert max(map(len, lines)) <= width
        assert lines[0].startswith(figure.title)


@pytest.mark.parametrize("figure", NOTHING)
def test_nothing_to_draw_is_said(figure):
    assert "nothing to draw" in figure_text(figure)
    assert "nothing to draw" in figure_svg(figure)


@pytest.mark.parametrize("kind", [*KINDS, *VIEWS])
@pytest.mark.parametrize("figure", [*FIGURES, *NOTHING])
def test_every_figure_is_well_formed_svg_that_says_what_it_is(figure, kind):
    found = svgs(figure_svg(figure, kind=kind))
    assert len(found) == (3 if isinstance(figure, Cloud) and kind not in VIEWS else 1)
    assert all(one.get("role") == "img" and one.get("aria-label").startswith(figure.title) for one in found)


@pytest.mark.parametrize("figure", [RESIDUAL, MAP])
def test_files_are_the_same_bytes_each_time(figure, tmp_path):
    for suffix in ("svg", "png"):
        save_figure(figure, tmp_path / f"one.{suffix}")
        save_figure(figure, tmp_path / f"two.{suffix}")
        assert (tmp_path / f"one.{suffix}").read_bytes() == (tmp_path / f"two.{suffix}").read_bytes()
    assert (tmp_path / "one.png").read_bytes().startswith(b"\x89PNG")
    ElementTree.parse(tmp_path / "one.svg")


def test_a_picture_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(UsageError, match=r"end it with \.png or \.svg"):
        save_figure(MAP, tmp_path / "one.gif")
    with pytest.raises(InputError, match="cannot write"):
        save_figure(MAP, tmp_path / "nowhere" / "one.svg")
    with pytest.raises(ValueError, match="no picture of kind pie"):
        figure_text(MAP, kind="pie")
    assert not list(tmp_path.iterdir())


def test_a_page_holds_everything_and_nothing_foreign():
    table = Table("KPIs", ("panel", "bias"), (("<one>", "0.1"),), ("bias",))
    page = Page("Panels", "All `hold`.", (Section("S", ("words",), (table,), FIGURES),), {"seed": "1"})
    text = page_html(page)
    assert text == page_html(page)
    assert "<script" not in text
    assert not re.findall(r"(?:src|href)=", text)
    assert not re.findall(r"https?://", text)
    for words in ("Panels", "<code>hold</code>", "&lt;one&gt;", '<td class="num">0.1</td>', "<code>1</code>"):
        assert words in text
    assert text.count('type="radio"') == 2 * len(KINDS) + len(VIEWS)
    assert len(svgs(text)) == 2 * len(KINDS) + len(VIEWS) + 4


def test_a_name_cannot_drive_the_terminal():
    sly = Distribution("a\x1b[2Jb", "c\x07", "m", {"d\x9b": X, "e\n": X})
    for kind in KINDS:
        assert "\x1b" not in figure_text(sly, kind=kind)
        assert len(figure_text(sly, kind=kind).splitlines()) == 15
    ElementTree.fromstring(figure_svg(sly))


def inside(text):
    """The lines within the frame."""
    return [re.split("[┤│]", line, maxsplit=1)[1] for line in text.splitlines() if line.endswith("│")]


def test_of_many_series_eight_are_drawn_and_the_rest_is_counted():
    names = [f"a rather long name of group {i}" for i in range(10)]
    many = Course("Many", "x", "y", tuple(Curve(name, X, X + 50 * i) for i, name in enumerate(names)))
    text, picture = figure_text(many), figure_svg(many)
    assert all(mark in "".join(inside(text)) for mark in "·#o+x*%@")
    assert all(f"group {i}" in text for i in range(8))
    assert "(2 more)" in text
    assert "and 2 more, not drawn" in picture
    assert set(re.findall(r'class="line s(\d)"', picture)) == set("01234567")


def test_a_series_of_which_there_is_nothing_is_named():
    half = Distribution("d", "q", "m", {"real": X, "simulated": np.array([np.nan])})
    for kind in KINDS:
        assert "(simulated: nothing)" in figure_text(half, kind=kind)
        assert "nothing)" in figure_svg(half, kind=kind) or "nothing to draw" in figure_svg(half, kind=kind)
    for figure in (
        Cloud("c", {"real": np.ones((2, 3)), "simulated": np.empty((0, 3))}),
        Course("c", "x", "y", (Curve("real", X, X), Curve("simulated", X, np.full(20, np.nan)))),
    ):
        assert "(simulated: nothing)" in figure_text(figure)
        assert "(simulated: nothing)" in figure_svg(figure)


def test_a_map_on_uneven_places_keeps_them(tmp_path):
    uneven = Grid("g", "x", "y", np.array([1.0, 2.0, 20.0]), np.array([0.0, 1.0]), np.array([[1.0, 2, 3], [1, 2, 3]]))
    row = inside(figure_text(uneven))[0]
    assert row.count("@") > 3 * row.count(".") > 0
    save_figure(uneven, tmp_path / "g.png")
    assert 'class="z5"' in figure_svg(uneven)


def test_a_cloud_keeps_its_sides_and_its_proportions():
    corner = Cloud("Corner", {"left": np.array([[10.0, 5.0, 0.0]]), "right": np.array([[10.0, -5.0, 2.0]])})
    rows = inside(figure_text(corner, kind="front", width=80, height=30))
    left, right = ([(i, row.index(mark)) for i, row in enumerate(rows) if mark in row] for mark in "·#")
    assert left[0][1] < right[0][1]
    assert left[0][0] > right[0][0]
    above = inside(figure_text(corner, kind="top", width=80, height=30))
    assert [i for i, row in enumerate(above) if "·" in row] < [i for i, row in enumerate(above) if "#" in row]
    ring = np.linspace(0.0, 2.0 * np.pi, 400)
    circle = np.column_stack([50.0 + 9.0 * np.cos(ring), 9.0 * np.sin(ring), ring])
    drawn = [row for row in inside(figure_text(Cloud("c", {"ring": circle}), kind="top", height=30)) if "·" in row]
    wide = max(row.rindex("·") for row in drawn) - min(row.index("·") for row in drawn) + 1
    assert wide == pytest.approx(2 * len(drawn), rel=0.15)
    flat = np.column_stack([ring * 30.0, 0.0 * ring, ring * 0.01])
    assert "not to one scale" in figure_text(Cloud("c", {"flat": flat}), kind="side")


def test_few_points_are_not_buried_under_many():
    crowd = Cloud("c", {"few": np.array([[50.0, 0.0, 0.0]]), "many": RNG.uniform(0.0, 100.0, (9000, 3)) - [0, 50, 0]})
    assert "·" in "".join(inside(figure_text(crowd, kind="top")))


def test_a_map_stands_as_it_is_given():
    values = np.zeros((9, 35))
    values[-1, -1] = 9.0
    rows = inside(figure_text(Grid("g", "x", "y", np.arange(35.0), np.arange(9.0), values), width=45))
    assert [len(row) for row in rows] == [36] * 9
    assert rows[0][34] == "@"
    assert "".join(rows).count("@") == 1
    values[0, 0], values[-1, -1], values[4, 7] = -9.0, 3.0, np.nan
    rows = inside(figure_text(Grid("g", "x", "y", np.arange(35.0), np.arange(9.0), values, diverging=True), width=45))
    assert (rows[-1][0], rows[0][34], rows[4][7], rows[4][8]) == ("=", "+", " ", ".")


def test_a_coarser_map_is_the_mean_of_what_falls_into_a_cell():
    from lidarcheck.figures.axes.map_cells import resampled

    values = np.arange(24.0).reshape(4, 6)
    values[0, 0] = np.nan
    grid = Grid("g", "x", "y", np.arange(6.0), np.arange(4.0), values)
    assert resampled(grid, 2, 3).tolist() == [[15.5, 17.5, 19.5], [(1 + 6 + 7) / 3, 5.5, 7.5]]
    fine = resampled(grid, 8, 12)
    assert fine[0].tolist() == np.repeat(values[3], 2).tolist()
    assert np.isnan(fine[-1, :2]).all()


def test_an_interval_is_drawn_around_its_curve():
    text = figure_text(Course("c", "x", "y", (Curve("real", X, X, X - 50.0, X + 50.0),)), height=30)
    assert ": interval" in text
    middle = [row for row in inside(text) if "·" in row]
    assert sum(":" in row for row in inside(text)) > len(middle)
    assert 'class="interval s0"' in figure_svg(DETECTED)


def test_a_shift_shows_in_every_kind():
    """The picture of values beside themselves shifted is not that of values beside themselves."""
    values = RNG.normal(0.0, 1.0, 2000)
    same = Distribution("d", "q", "m", {"real": values, "simulated": values})
    moved = Distribution("d", "q", "m", {"real": values, "simulated": values + 1.0})
    for kind in KINDS:
        assert figure_text(same, kind=kind) != figure_text(moved, kind=kind)
    (dots,) = subplots_of(moved, "qq")[0].dots
    assert np.allclose(dots.y - dots.x, 1.0)


def test_colours_of_png_are_those_of_the_page():
    from importlib import resources

    from lidarcheck.figures.png.figure import COLOURS

    style = (resources.files("lidarcheck.figures") / "templates" / "colours.css").read_text()
    light = dict(reversed(re.findall(r"--s(\d): (#\w+)", style)))
    assert tuple(light[str(i)] for i in range(8)) == COLOURS


def test_pictures_are_the_same_drawn_by_one_process_or_by_three(tmp_path, monkeypatch):
    from lidarcheck.figures.files import result_folder
    from lidarcheck.workers import cores

    rng = np.random.default_rng(3)
    figures = [Distribution(f"AREA {k}", "AREA", "", {"real": rng.normal(size=50)}) for k in range(40)]
    drawn = []
    for jobs in (1, 3):
        monkeypatch.setattr(cores, "usable_cores", lambda jobs=jobs: jobs)
        place = tmp_path / str(jobs)
        place.mkdir()
        result_folder.draw_pictures(figures, place, "histogram")
        drawn.append({path.name: path.read_bytes() for path in place.iterdir()})
    assert len(drawn[0]) == 40
    assert drawn[0] == drawn[1]


@pytest.mark.parametrize(("library", "backend"), [("matplotlib", "png"), ("plotext", "terminal")])
def test_a_drawing_library_is_known_to_its_backend_alone(library, backend):
    figures = Path(lidarcheck.__file__).parent / "figures"
    importing = re.compile(rf"^\s*(?:import|from) {library}\b", re.MULTILINE)
    files = [path for path in figures.parent.rglob("*.py") if importing.search(path.read_text(encoding="utf-8"))]
    assert files
    assert {path.parent for path in files} == {figures / backend}


def test_dots_are_joined_by_no_line():
    many = np.linspace(0.0, 9.0, 200)
    figure = Course("c", "x", "y", (Curve("a", many, many, dots=True), Curve("b", many, many + 1.0)))
    (subplot,) = subplots_of(figure, "histogram")
    assert [line.series for line in subplot.lines] == [1]
    assert [len(dots.x) for dots in subplot.dots] == [200]
    assert subplot.drawn() == {0, 1}
