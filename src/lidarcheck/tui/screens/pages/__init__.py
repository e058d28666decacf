"""Screens that show the pages of a workflow."""
