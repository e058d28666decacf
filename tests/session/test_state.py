"""What the interface remembers from one start to the next."""

from lidarcheck.session.state import State, load_state, save_state


def test_the_state_survives_and_a_damaged_one_is_a_fresh_one(tmp_path):
    save_state(State("blooming", "plain", "blocks", True, {"row": "3"}), tmp_path)
    assert load_state(tmp_path) == State("blooming", "plain", "blocks", True, {"row": "3"})
    assert (tmp_path / ".lidarcheck/.gitignore").read_text() == "*\n"
    for text in ("", "[]", '{"selected": 3, "screen": null}'):
        (tmp_path / ".lidarcheck/tui/state.json").write_text(text)
        assert load_state(tmp_path).selected == {}
