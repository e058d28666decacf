"""The commands of cases: make one from files, and say what its data can show."""
