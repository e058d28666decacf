"""What each workflow of calibration shows: its result as a page of figures, tables and words."""
