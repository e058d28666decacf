import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.errors import ConfigError, InputError, LidarcheckError, UsageError
from lidarcheck.formats.lut import load_lut, parse_lut, save_lut
from lidarcheck.formats.lut_scale import scaled_of_y, y_of_scaled
from places import shared_path

SMALL = (
    b"\xef\xbb\xbf; Gr\xfc\xdfe = 1, 2\r\n"
    b"[Sensor]\r\n"
    b"other.Key=3,  4 ; x\r\n"
    b"\tpostpro.LUT_BLOOMING_x\t=\t-2.5 ,0,1e1,10.0,  10 # pad\r\n"
    b"\r\n"
    b"PostPro.Lut_Blooming_Y = 0.00001, 1,0.5 ,  .25,0\r\n"
    b"PostPro.LUT_bloomingH_X = 0, 1\n"
    b"PostPro.LUT_bloomingH_Y = 1, 0.02"
)


def test_the_sample_tables() -> None:
    vertical = load_lut(shared_path("samples/vertical_lut.ini"))
    assert list(vertical.tables) == ["vertical"]
    table = vertical.tables["vertical"]
    assert len(table) == 31
    assert (table.x[0], table.x[-1]) == (-160.0, 250.0)
    assert table.y[13] == 1.0
    horizontal = load_lut(shared_path("samples/horizontal_lut.ini"))
    assert list(horizontal.tables) == ["horizontal"]
    assert horizontal.tables["horizontal"].x[-5:].tolist() == [150.0] * 5
    assert horizontal.tables["horizontal"].rows()[1] == (1.0, 0.02, 757)


def test_printed_values_lie_on_the_grid_of_the_editor() -> None:
    table = load_lut(shared_path("samples/vertical_lut.ini")).tables["vertical"]
    for row in table.rows():
        assert abs(row.y - y_of_scaled(row.scaled)) <= 0.5e-7


@pytest.mark.parametrize("name", ["vertical_lut.ini", "horizontal_lut.ini"])
def test_an_untouched_file_keeps_its_bytes(tmp_path: Path, name: str) -> None:
    source = shared_path(f"samples/{name}")
    save_lut(load_lut(source), tmp_path / name)
    assert (tmp_path / name).read_bytes() == source.read_bytes()


def test_scale() -> None:
    assert [scaled_of_y(y) for y in (0.0, 1e-300, 1e-7, 1.1e-7, 0.02, 0.99, 1.0)] == [0, 1, 1, 6, 757, 999, 1000]
    assert y_of_scaled(0) == 0.0
    assert y_of_scaled(1000) == 1.0
    assert [scaled_of_y(y_of_scaled(s)) for s in range(1001)] == list(range(1001))
    for bad in (-1, 1001, 2.5, True, float("nan"), float("inf")):
        with pytest.raises(UsageError, match="whole number from 0 to 1000"):
            y_of_scaled(bad)  # type: ignore[arg-type]


def test_from_the_fineness_of_seven_decimals_on_a_written_scale_reads_back() -> None:
    lut = parse_lut(SMALL)
    for scaled in [0, *range(260, 1001, 20), 1000]:
        assert lut.with_scaled("vertical", 2, scaled).tables["vertical"].rows()[2].scaled == scaled


def test_only_the_edited_cell_changes() -> None:
    lut = parse_lut(SMALL)
    edited = lut.with_scaled("vertical", 3, 757)
    assert edited.content == SMALL.replace(b"  .25,", b"  0.0199067,")
    assert lut.content == SMALL
    assert edited.with_y("horizontal", 1, 0.5).content == SMALL.replace(b"  .25,", b"  0.0199067,").replace(
        b"0.02", b"0.5000000"
    )
    assert lut.with_y("vertical", 4, 0.0) is lut
    assert lut.with_scaled("vertical", 0, 286) is lut, "the number it shows already: its exact Y stays"
    assert lut.with_y("vertical", 0, 0).content == SMALL.replace(b"0.00001,", b"0.0000000,")


def test_edits_that_do_not_fit() -> None:
    lut = parse_lut(SMALL)
    for value in (-0.1, 1.1, float("nan"), float("inf")):
        with pytest.raises(UsageError, match="from 0 to 1"):
            lut.with_y("vertical", 0, value)
    with pytest.raises(UsageError, match=r"at least 0\.0000001"):
        lut.with_y("vertical", 0, 4e-8)
    for index in (-1, 5):
        with pytest.raises(UsageError, match="use 0 to 4"):
            lut.with_y("vertical", index, 0.5)
    only_vertical = parse_lut(SMALL[: SMALL.index(b"PostPro.LUT_bloomingH_X")])
    with pytest.raises(UsageError, match="no horizontal table; choose vertical"):
        only_vertical.with_scaled("horizontal", 0, 5)


def test_interpolation_is_linear_in_y_and_zero_outside() -> None:
    table = parse_lut(SMALL).tables["vertical"]
    assert table.interp([-3.0, -2.5, -1.25, 0.0, 5.0, 10.0, 10.1]).tolist() == pytest.approx(
        [0.0, 1e-5, 0.500005, 1.0, 0.75, 0.0, 0.0]
    )
    assert table.interp(np.zeros((2, 3))).shape == (2, 3)
    with pytest.raises(ValueError):
        table.x[0] = 1.0


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        (b"", [": the file is empty; was it written completely?"]),
        (b"# nothing\n", [": the file has no blooming table; add PostPro.LUT_blooming_X and _Y"]),
        (
            b"\nPostPro.LUT_bloming_X = 1\nPostPro.LUT_bloming_Y = 1\n",
            [
                ": the file has no blooming table; "
                'did you mean PostPro.LUT_blooming_X by "PostPro.LUT_bloming_X" in line 2?'
            ],
        ),
        (
            b"PostPro.LUT_blooming_X = 1, 2\n",
            [":1: PostPro.LUT_blooming_X has no PostPro.LUT_blooming_Y; add PostPro.LUT_blooming_Y with 2 numbers"],
        ),
        (
            b"PostPro.LUT_blooming_Y = 1, 2\nPostPro.LUT_bloming_X=1",
            [
                ":1: PostPro.LUT_blooming_Y has no PostPro.LUT_blooming_X; "
                'did you mean PostPro.LUT_blooming_X by "PostPro.LUT_bloming_X" in line 2?'
            ],
        ),
        (
            b"PostPro.LUT_blooming_X = 1, 3, 2, 4,, x\nPostPro.LUT_blooming_Y = 0,1.5,-1,nan, 1e999\n",
            [
                ":1: number 5 of PostPro.LUT_blooming_X is empty; write numbers as 0.5, 0.25",
                ':1: number 6 of PostPro.LUT_blooming_X is "x", not a number; write numbers as 0.5, 0.25',
                ":1: number 3 of PostPro.LUT_blooming_X is 2, below 3 before it; X must not decrease",
                ':2: number 4 of PostPro.LUT_blooming_Y is "nan", not a number; write numbers as 0.5, 0.25',
                ':2: number 5 of PostPro.LUT_blooming_Y is "1e999", not a number; write numbers as 0.5, 0.25',
                ":2: PostPro.LUT_blooming_Y has 5 numbers, PostPro.LUT_blooming_X has 6; give both the same number",
                ":2: number 2 of PostPro.LUT_blooming_Y is 1.5, out of range; use a number from 0 to 1",
                ":2: number 3 of PostPro.LUT_blooming_Y is -1, out of range; use a number from 0 to 1",
            ],
        ),
        (
            b"PostPro.LUT_blooming_X = 1\nPostPro.LUT_blooming_Y =1\n\rPOSTPRO.LUT_blooming_X = 2\n",
            [":4: POSTPRO.LUT_blooming_X stands here again; remove it or line 1"],
        ),
        (
            b"PostPro.LUT_blooming_X = # none\nPostPro.LUT_blooming_Y =\n",
            [
                ":1: PostPro.LUT_blooming_X has no numbers; add them, with commas",
                ":2: PostPro.LUT_blooming_Y has no numbers; add them, with commas",
            ],
        ),
        ("a = 1\n".encode("utf-16"), [":1: this is not a text file in UTF-8 or ASCII; save it as UTF-8"]),
    ],
)
def test_faults(tmp_path: Path, text: bytes, messages: list[str]) -> None:
    path = tmp_path / "l.ini"
    path.write_bytes(text)
    with pytest.raises(LidarcheckError) as caught:
        load_lut(path)
    assert [line.removeprefix(f"error: {path}") for line in caught.value.lines()] == messages


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_lut(tmp_path / "none.ini")


def test_padding_lines_of_any_length_are_read_at_once() -> None:
    parse_lut(SMALL + b"\n" + b"a" + b" " * 300_000 + b"\n" + b"#" * 300_000)


SPACE = st.sampled_from(["", " ", "  ", "\t", " \t "])
NOISE = st.sampled_from(["", "# c = 1", "; x", "[s]", "Other.Key = 1,2", "gr\xfcn=\xe9", "no equals here"])


@st.composite
def lut_texts(draw: st.DrawFn) -> tuple[bytes, list[float], list[str]]:
    """A LUT text with one table: its bytes, X, and the text of each Y."""
    newline = draw(st.sampled_from(["\n", "\r\n"]))
    x = sorted(draw(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=8)))
    y = draw(
        st.lists(
            st.sampled_from(["0", "1", "1.0", "0.00001", ".5", "1e-5", "+0.25", "0.0000301", "0.", "-0.0"]),
            min_size=len(x),
            max_size=len(x),
        )
    )
    cells = [",".join(f"{draw(SPACE)}{cell}{draw(SPACE)}" for cell in column) for column in ([str(v) for v in x], y)]
    prefix = draw(st.sampled_from(["PostPro.LUT_bloomingH_", "postpro.lut_blooming_", "POSTPRO.LUT_BLOOMING_"]))
    lines = [f"{draw(SPACE)}{prefix}{name}{draw(SPACE)}={cell}" for name, cell in zip("XY", cells, strict=True)]
    noise = draw(st.lists(NOISE, min_size=3, max_size=3))
    text = newline.join([noise[0], lines[0], noise[1], lines[1], noise[2]])
    bom = draw(st.sampled_from([b"", b"\xef\xbb\xbf"]))
    return bom + (text + draw(st.sampled_from(["", newline]))).encode("latin-1"), x, y


@settings(max_examples=examples(150), deadline=None)
@given(case=lut_texts(), data=st.data())
def test_any_table_reads_and_an_edit_touches_one_cell(
    case: tuple[bytes, list[float], list[str]], data: st.DataObject
) -> None:
    content, x, y = case
    lut = parse_lut(content)
    [(axis, table)] = lut.tables.items()
    assert table.x.tolist() == x
    assert table.y.tolist() == [float(cell) for cell in y]
    assert lut.content == content
    index = data.draw(st.integers(0, len(x) - 1))
    scaled = data.draw(st.integers(1, 1000))
    edited = lut.with_scaled(axis, index, scaled)
    if scaled == table.rows()[index].scaled:
        assert edited is lut
        return
    new = f"{y_of_scaled(scaled):.7f}".encode()
    cell = table._cells[index]
    assert edited.content == content[: cell.start] + new + content[cell.start + len(y[index]) :]
    after = edited.tables[axis]
    assert after.x.tolist() == x
    assert np.delete(after.y, index).tolist() == np.delete(table.y, index).tolist()
    assert after.y[index] == float(new)


@settings(max_examples=examples(300), deadline=None)
@given(
    edits=st.lists(st.tuples(st.integers(0, len(SMALL) - 1), st.integers(0, 255)), max_size=4),
    cut=st.none() | st.integers(0, len(SMALL)),
)
def test_a_damaged_file_is_read_or_refused_in_single_lines(edits: list[tuple[int, int]], cut: int | None) -> None:
    content = bytearray(SMALL)
    for position, byte in edits:
        content[position] = byte
    damaged = bytes(content)[:cut]
    try:
        lut = parse_lut(damaged, Path("d.ini"))
    except LidarcheckError as error:
        for line in error.lines():
            assert re.match(r"error: d\.ini(:\d+)?: .+; .+", line)
            assert line.isprintable()
    else:
        assert lut.content == damaged
        for table in lut.tables.values():
            assert np.all(np.diff(table.x) >= 0)
            assert np.all((table.y >= 0) & (table.y <= 1))


def test_all_faults_are_counted(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_lut(b"PostPro.LUT_blooming_X=2,1\nPostPro.LUT_blooming_Y=2,3\n")
    assert len(caught.value.faults) == 3
