"""The reference by detectors: every SPAD on its own, slow and simple; varying dead times or two effects need it."""
