"""The commands of sensor files, a file each: from, list, show."""
