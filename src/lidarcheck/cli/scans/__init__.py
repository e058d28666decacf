"""The commands that take scans as they are: compare, convert, info."""
