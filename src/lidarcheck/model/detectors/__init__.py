"""The reference by detectors: every SPAD on its own, slow and simple; crosstalk and varying dead times need it."""
