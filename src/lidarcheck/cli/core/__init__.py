"""What all commands share: the parser, the entry, options, outputs, help and the terminal.

`entry` runs a command line, `app` lists the commands, `workflow_output` writes what a calibration workflow found.
"""
