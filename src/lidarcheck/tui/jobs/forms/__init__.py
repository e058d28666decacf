"""What is asked before a long command is started, and the command that the answers make."""
