"""Fixtures that several rooms of tests share."""

import gc
import os

import pytest
from hypothesis import settings

from budget import WHOLE

settings.register_profile(
    "steady", derandomize=True, database=None
)  # the gate is red for what changed, never by chance
settings.register_profile("search")
settings.load_profile("search" if WHOLE else "steady")

collect_ignore = ["data"]  # a project of its own, whose scenarios the pytest plugin would run
pytest_plugins = ("command_kit",)


def pytest_collection_finish():
    """What was collected stays to the end: looking through it for rubbish again and again takes a tenth of the time."""
    gc.freeze()
    gc.set_threshold(10_000)


@pytest.fixture(autouse=True, scope="session")
def nobody(tmp_path_factory):
    """The tests run as a user without a configuration, who trusts no program."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.mktemp("user")))
        patch.delenv("LIDARCHECK_TRUST", raising=False)
        yield


@pytest.fixture(autouse=True, scope="session")
def nothing_is_unplugged():
    """No test can notice whether the disk has a file already, and waiting for that takes milliseconds a file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _descriptor: None)
        yield


@pytest.fixture(scope="module")
def trusting():
    """The user trusts every program, to the end of the module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LIDARCHECK_TRUST", "all")
        yield
