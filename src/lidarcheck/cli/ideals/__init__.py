"""The commands that make ideal scans from measurements, a file each."""
