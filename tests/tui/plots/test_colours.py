"""Colours of plots: told in the depth that the terminal has, so that rounding never makes two of them the same."""

import pytest
from rich.color import ColorSystem

from lidarcheck.tui.plots.colours import PLOT_ROLES
from lidarcheck.tui.widgets.themes import THEMES, style

TOLD = ("real", "now", "saved")


def codes(theme, role, depth, system):
    return style(theme, role, depth).render("x", color_system=system)


@pytest.mark.parametrize(("theme", "expected"), [("dark", (74, 214, 245)), ("light", (25, 166, 241))])
def test_of_256_colours_each_has_its_own(theme, expected):
    for role, number in zip(TOLD, expected, strict=True):
        assert f"38;5;{number}" in codes(theme, role, "256", ColorSystem.EIGHT_BIT)


@pytest.mark.parametrize(("theme", "expected"), [("dark", (96, 93, 90)), ("light", (34, 31, 90))])
def test_of_16_colours_each_has_its_own(theme, expected):
    for role, code in zip(TOLD, expected, strict=True):
        assert f"{code}" in codes(theme, role, "16", ColorSystem.STANDARD).split("m")[0].split("[")[1].split(";")


@pytest.mark.parametrize("theme", THEMES)
def test_without_colours_none_is_sent_by_a_plot(theme):
    for role in PLOT_ROLES:
        assert style(theme, role, "none").color == style(theme, "text").color
    assert style(theme, "both", "none").bold


@pytest.mark.parametrize("theme", THEMES)
def test_every_role_is_told_apart_by_truecolour(theme):
    assert len({str(style(theme, role).color) for role in TOLD}) == 3
