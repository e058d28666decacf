"""The kinds of KPI that a scenario can ask for, and which echoes and beams each looks at.

`registry` has all kinds by name; a new one is an entry in `surface`, `echoes` or `readout`.
"""
