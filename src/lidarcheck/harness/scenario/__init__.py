"""Scenarios: the file, its beams, what it asks for, and measuring it."""
