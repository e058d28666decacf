"""The gate: which seeds run, what chance gives, and whether a KPI has moved.

`gate` gives the verdict on one KPI, `evidence` what it rests on, `seeds` runs what it needs.
"""
