"""The gate: which seeds run, what chance gives, and whether a KPI has moved."""
