"""Text that is damaged at random: a scan or one error, and the same whichever way it is read."""

import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats import load_ideal, load_scan
from lidarcheck.formats.cells import CellFault, slow_columns
from lidarcheck.formats.convert import describe
from lidarcheck.formats.rows import REAL_COLUMNS, fast_columns, single_blanks
from places import shared_path

HEAD = b"//X Y Z Layer Point EchoNumber WIDTH AREA PEAK\n"
ROW = b"1.5 2.5 3.5 100 200 1 5 50 20\n"
IDEAL = b"//Layer Point Distance MaterialID IncidenceAngle\n"
JUNK = [
    b"\0",
    b"\xff",
    b"nan",
    b",",
    b";",
    b'"',
    b"\n",
    b"\r",
    b"\t",
    b"-",
    b"e",
    b"1e999",
    b"//",
    b"#",
    b"9" * 40,
    b"=",
    b"[",
]


@settings(deadline=None, max_examples=examples(400))
@given(data=st.data(), seed=st.integers(0, 2**32))
def test_a_mutated_text_is_a_scan_or_one_error(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, seed: int
) -> None:
    base = data.draw(
        st.sampled_from([HEAD + b"3\n" + ROW * 3, (HEAD + ROW * 3).replace(b" ", b","), IDEAL + b"1 2 3 4 5\n" * 4])
    )
    content = bytearray(base)
    dice = random.Random(seed)
    for _ in range(dice.randint(1, 4)):
        at = dice.randrange(len(content) + 1)
        kind = dice.randrange(4)
        if kind == 0:
            content[at : at + 1] = bytes([dice.randrange(256)])
        elif kind == 1:
            content[at:at] = dice.choice(JUNK)
        elif kind == 2:
            del content[at : at + dice.randint(1, 30)]
        else:
            del content[at:]
            content += b"" if dice.random() < 0.8 else base[dice.randrange(len(base)) :]
        if not content:
            break
    path = tmp_path_factory.mktemp("fuzz") / data.draw(st.sampled_from(["f.txt", "f.csv", "f.pcd"]))
    path.write_bytes(bytes(content))
    for load in (load_scan, load_ideal, describe):
        lines: list[str] = []
        try:
            load(path)
        except LidarcheckError as error:
            lines = error.lines()
        assert len(lines) <= 1
        assert all(line.startswith(f"error: {path}") for line in lines)


@pytest.mark.parametrize("name", ["samples/1_25m.txt", "samples/2_45m.txt"])
def test_a_truncated_sample_is_refused(tmp_path: Path, name: str) -> None:
    content = shared_path(name).read_bytes().rstrip()
    path = tmp_path / "cut.txt"
    last = len(content) - len(content.split()[-1])
    for end in range(0, last, 7):
        path.write_bytes(content[:end])
        with pytest.raises(LidarcheckError) as caught:
            load_scan(path)
        assert len(caught.value.lines()) == 1


CELLS = st.text("0123456789+-.eE \t\r\n,na\x0b\0", max_size=12).map(str.encode)


@settings(deadline=None, max_examples=examples(1500))
@given(
    body=st.lists(CELLS | st.integers(-99, 99).map(lambda n: b"%d" % n), max_size=9), gap=st.sampled_from([b" ", b"\n"])
)
def test_the_fast_path_takes_nothing_that_the_slow_path_refuses(body: list[bytes], gap: bytes) -> None:
    for delimiter, names in ((" ", ["X", "other"]), (",", ["X", "other"]), ("\t", ["X", "other"]), (" ", ["other"])):
        content = gap.join(body).strip(b" \t\r\n")
        for odd in (set[str](), {"other"} & set(names[1:])):
            for single in (content, single_blanks(content) if delimiter == " " else content):
                fast = fast_columns(single, names, delimiter, odd) if single else None
                if fast is not None:
                    slow = slow_columns(content, names, delimiter, REAL_COLUMNS, odd)
                    assert not isinstance(slow, CellFault)
                    assert slow[1] == {}
                    assert all(
                        np.array_equal(fast[name], slow[0][name], equal_nan=True)
                        and fast[name].dtype == slow[0][name].dtype
                        for name in names
                        if name not in odd
                    )
