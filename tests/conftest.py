"""Fixtures that several rooms of tests share."""

collect_ignore = ["data"]  # a project of its own, whose scenarios the pytest plugin would run
pytest_plugins = ("command_kit",)
