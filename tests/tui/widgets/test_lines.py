"""Lines of a pane: what is wider than the pane is folded."""

from lidarcheck.tui.widgets.lines import folded


def test_a_folded_line_keeps_its_roles_and_every_letter():
    assert folded((("short", "text"),), 10) == [(("short", "text"),)]
    parts = (("one two ", "title"), ("three 漢字漢字漢字漢字 four", "bad"))
    rows = folded(parts, 24)
    assert rows == [(("one two ", "title"), ("three ", "bad")), (("  ", "text"), ("漢字漢字漢字漢字 four", "bad"))]
    assert [row[0][0] for row in folded((("abcdef", "text"),), 2)] == ["ab", "cd", "ef"]
    assert len(folded((("漢字", "text"),), 1)) == 2
