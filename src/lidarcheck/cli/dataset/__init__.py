"""The commands of data sets: scan."""
