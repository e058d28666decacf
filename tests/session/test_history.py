"""Edits of a file as data: packed, and giving every content back."""

import random

import pytest

from lidarcheck.session.history import Edit, History, edit_between


def test_a_history_is_packed_and_gives_every_content_back():
    draw, history = random.Random(4), History()
    content = bytes(draw.randrange(256) for _ in range(400))
    contents = [content]
    for number in range(120):
        at, end = sorted(draw.randrange(len(content) + 1) for _ in range(2))
        new = content[:at] + bytes(draw.randrange(256) for _ in range(draw.randrange(30))) + content[end:]
        edit = edit_between(content, new, f"edit {number}")
        if edit is not None:
            assert edit == Edit.of(edit.record())
            history.add(edit)
            content = new
            contents.append(new)
    for before in reversed(contents[:-1]):
        content = history.move("undo").applied(content, back=True)
        assert content == before
    assert history.last("undo") is None
    for after in contents[1:]:
        content = history.move("redo").applied(content)
        assert content == after
    with pytest.raises(ValueError, match="for another content"):
        history.last("undo").applied(b"something else" * 99, back=True)
