"""What each workflow of calibration shows: its result as a `Page` of figures, tables and words, nothing drawn."""
