"""Readers and writers, one file a format; `load_*` recognise by content, `save_*` go by suffix."""
