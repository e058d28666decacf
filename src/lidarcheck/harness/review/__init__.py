"""Reviewing proposals and accepting them, and the reference of a release."""
