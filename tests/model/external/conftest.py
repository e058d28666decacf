import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from lidarcheck.model.external import residents


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Temporary directories are made here, and none is left when what stays up has ended."""
    path = tmp_path / "scratch"
    path.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(path))
    yield path
    residents.end_all()
    assert list(path.iterdir()) == []
