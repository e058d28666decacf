"""Proposals: what a golden would become, and scenarios that would have caught what explain found.

`propose` makes such a scenario, `candidates` chooses what it looks at, `trial` tries it.
"""
