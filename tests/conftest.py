"""Fixtures that several rooms of tests share."""

pytest_plugins = ("command_kit",)
