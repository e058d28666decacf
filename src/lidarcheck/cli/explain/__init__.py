"""`lidarcheck explain`: the command, its benchmark, what it writes, and what is shown while it runs."""
