"""The commands of the harness, a file each: check, review, report."""
