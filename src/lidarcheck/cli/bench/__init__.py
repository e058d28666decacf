"""`lidarcheck bench`: speed on this machine, each figure beside what a user would otherwise take."""
