"""What the terminal interface knows and does, without a terminal: project, sessions, journal, actions."""
