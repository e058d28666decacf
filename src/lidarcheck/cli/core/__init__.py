"""What all commands share: the parser, the entry, options, outputs, help and the terminal."""
