"""Which rows of a table belong to which frame: by column, by time, by the order of rows; and what is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.frames import frames_of, one_frame
from lidarcheck.formats.table import Table

LAYERS, POINTS = 6, 40


def frame(rng, number, *, share=0.8, columns_first=False, returns=1):
    """A frame's columns: a share of the beams with up to `returns` echoes each, in one order, each with its time."""
    layer, point = np.divmod(np.arange(LAYERS * POINTS), POINTS)
    if columns_first:
        point, layer = np.divmod(np.arange(LAYERS * POINTS), LAYERS)
    seen = rng.random(len(layer)) < share
    layer, point = layer[seen], point[seen]
    echoes = rng.integers(1, returns + 1, len(layer))
    beam = np.repeat(np.arange(len(layer)), echoes)
    echo = np.arange(len(beam)) - np.repeat(np.cumsum(echoes) - echoes, echoes) + 1
    return {
        "X": rng.uniform(10.0, 20.0, len(beam)) + 5.0 * echo,
        "Y": rng.normal(size=len(beam)),
        "Z": rng.normal(size=len(beam)),
        "Layer": layer[beam],
        "Point": point[beam],
        "EchoNumber": echo,
        "timestamp": 0.1 * number + 0.001 * point[beam],
        "Frame": np.full(len(beam), 3 * number + 2),
    }


def merged(frames, leave_out=(), order=None):
    columns = {name: np.concatenate([one[name] for one in frames]) for name in frames[0] if name not in leave_out}
    return Table({name: column if order is None else column[order] for name, column in columns.items()})


def same(table, frames, order=None):
    """Whether the frames found are those merged, row by row and bit by bit."""
    found = frames_of(table)
    assert len(found) == len(frames)
    number = np.repeat(np.arange(len(frames)), [len(one["X"]) for one in frames])
    number = number if order is None else number[order]
    for i in range(len(frames)):
        mine, rows = found.take(table, i), np.flatnonzero(number == i)
        assert mine.origin is not None
        assert mine.origin.tolist() == rows.tolist()
        for name, column in mine.columns.items():
            assert column.tobytes() == table.columns[name][rows].tobytes()
    return found


@settings(max_examples=examples(60), deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(2, 7),
    st.integers(1, 3),
    st.booleans(),
    st.sampled_from(["frame", "time", "order"]),
)
def test_frames_that_were_merged_are_found_again(seed, count, returns, columns_first, way):
    rng = np.random.default_rng(seed)
    share = rng.uniform(0.5, 1.0)
    frames = [frame(rng, i, share=share, columns_first=columns_first, returns=returns) for i in range(count)]
    left = {"frame": (), "time": ("Frame",), "order": ("Frame", "timestamp")}[way]
    rows = sum(len(one["X"]) for one in frames)
    order = None if way == "order" else rng.permutation(rows)
    assert same(merged(frames, left, order), frames, order).way == way


@settings(max_examples=examples(60), deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.integers(1, 3), st.booleans())
def test_whole_passes_without_echo_numbers_are_frames(seed, count, returns, columns_first):
    rng = np.random.default_rng(seed)
    frames = [frame(rng, i, share=0.9, columns_first=columns_first, returns=returns) for i in range(count)]
    table = merged(frames, ("Frame", "timestamp", "EchoNumber"))
    assert same(table, frames).way == "order"


@settings(max_examples=examples(60), deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.booleans(), st.booleans(), st.booleans())
def test_one_frame_is_one_frame_in_any_order_of_rows(seed, returns, columns_first, shuffled, numbered):
    rng = np.random.default_rng(seed)
    one = frame(rng, 1, columns_first=columns_first, returns=returns)
    order = rng.permutation(len(one["X"])) if shuffled else None
    table = merged([one], () if numbered else ("EchoNumber",), order)
    assert one_frame(table) is table


def test_a_column_frame_of_one_value_does_not_hide_repeats():
    rng = np.random.default_rng(1)
    frames = [frame(rng, i) for i in range(3)]
    for one in frames:
        one["Frame"] = np.zeros_like(one["Frame"])
    assert same(merged(frames), frames).way == "time"


@pytest.mark.parametrize("name", ["Frame", "FRAME", "frame_id", "framenumber"])
def test_a_frame_column_has_several_names(name):
    table = Table({"X": np.zeros(4), "Y": np.zeros(4), "Z": np.zeros(4), name: np.array([7, 7, 9, 9])})
    found = frames_of(table)
    assert (len(found), found.column, found.labels()) == (2, name, [7, 9])


def test_a_copy_beside_its_twin_is_no_new_frame():
    one = frame(np.random.default_rng(2), 0)
    twice = {name: np.repeat(column, 2) for name, column in one.items()}
    assert len(frames_of(Table(twice))) == 1


def test_second_echoes_behind_the_first_ones_are_no_new_frame():
    rng = np.random.default_rng(3)
    one = frame(rng, 0, share=1.0)
    some = np.flatnonzero(rng.random(len(one["X"])) < 0.2)
    later = {name: column[some] for name, column in one.items()}
    later["X"] = later["X"] + 8.0
    assert len(frames_of(merged([one, later], ("EchoNumber", "Frame", "timestamp")))) == 1


def test_echoes_beside_each_other_are_no_new_frame_but_frames_are():
    rng = np.random.default_rng(4)
    frames = [frame(rng, i, share=1.0) for i in range(2)]
    frames[1]["X"] = frames[0]["X"] + rng.normal(0.0, 0.01, len(frames[0]["X"]))
    without = ("Frame", "timestamp", "EchoNumber")
    together = merged(frames, without)
    order = np.lexsort((together.columns["Point"], together.columns["Layer"]))
    with pytest.raises(InputError, match="several frames"):
        frames_of(together.take(order))
    frames[1]["X"] = frames[0]["X"] + 5.0
    assert len(frames_of(merged(frames, without).take(order))) == 1


def test_what_nothing_tells_apart_is_refused_with_the_command():
    rng = np.random.default_rng(5)
    frames = [frame(rng, i) for i in range(3)]
    rows = sum(len(one["X"]) for one in frames)
    table = merged(frames, ("Frame", "timestamp"), rng.permutation(rows))
    with pytest.raises(InputError) as refused:
        one_frame(table)
    assert "neither a column Frame, nor a time, nor the order of the rows" in refused.value.what
    assert refused.value.fix.endswith("lidarcheck split FILE --out FILE_frames --by COLUMN")


def test_several_frames_are_refused_where_one_is_wanted():
    rng = np.random.default_rng(6)
    with pytest.raises(InputError, match="holds 2 frames, told apart by the column Frame, where one is wanted"):
        one_frame(merged([frame(rng, 0), frame(rng, 1)]))


def test_by_takes_another_column_or_way():
    rng = np.random.default_rng(7)
    frames = [frame(rng, i) for i in range(2)]
    for i, one in enumerate(frames):
        one["sweep"] = np.full(len(one["X"]), 1.5 * i)
    table = merged(frames)
    assert [frames_of(table, by).column for by in ("frame", "time", "order", "SWEEP")] == [
        "Frame",
        "timestamp",
        "",
        "sweep",
    ]
    assert frames_of(table, "sweep").labels() == [0, 1]
    with pytest.raises(UsageError, match="--by scan is no column"):
        frames_of(table, "scan")


def test_repeats_of_an_ideal_scan_are_sub_beams():
    beams = {"Layer": np.repeat(np.arange(5), 2), "Point": np.zeros(10, dtype=int), "Distance": np.full(10, 9.0)}
    ideal = {**beams, "MaterialID": np.ones(10, dtype=int)}
    assert len(frames_of(Table(ideal))) == 1
    assert len(frames_of(Table({**ideal, "Frame": np.tile([0, 1], 5)}))) == 2
    with pytest.raises(InputError, match="is an ideal scan"):
        frames_of(Table(ideal), "order")


def test_a_frame_without_a_number_is_refused():
    table = Table({"X": np.zeros(2), "Y": np.zeros(2), "Z": np.zeros(2), "Frame": np.array([1.0, np.nan])})
    with pytest.raises(InputError, match="row 2: Frame is nan"):
        frames_of(table)
