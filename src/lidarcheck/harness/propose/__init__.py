"""Proposals: what a golden would become, and scenarios that would have caught what explain found."""
