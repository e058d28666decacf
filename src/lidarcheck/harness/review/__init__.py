"""Reviewing proposals and accepting them, and the reference of a release.

`review` shows what is proposed and what speaks against it, `accept` writes goldens, `release` sets the reference.
"""
