"""The reference by detectors: every SPAD on its own, slow and simple; varying dead times and effects together need it."""
