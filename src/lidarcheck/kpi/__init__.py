"""KPIs of measured against simulated samples: pure functions of arrays.

Measured comes first, simulated second, and a difference is measured minus simulated. A KPI of nothing is NaN, never
0. One file a family: `distances`, `validation`, `pairing` (echoes and surfaces), `detection`, `walk`, `blooming`,
`ghost`, `overlap`, `scatter`; `compare` runs all that two scans allow.
"""
