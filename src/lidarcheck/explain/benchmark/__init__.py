"""The benchmark of the gap workflow: cases in which a generator hid effects, run and scored."""
