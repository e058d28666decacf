"""KPIs of measured against simulated samples: pure functions of arrays."""
