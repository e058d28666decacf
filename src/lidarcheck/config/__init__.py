"""Configuration as TOML: strict tables, all faults at once, each with its line and the nearest valid key."""
