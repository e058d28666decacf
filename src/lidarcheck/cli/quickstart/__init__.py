"""`lidarcheck quickstart`: from a recording to a verdict, each step a command that a person can run."""
