"""Widgets, each of lines of text: what changes is redrawn line by line, since over SSH every byte counts."""
