"""What a person has open: the project, the files being edited, undo, a journal that outlives the process, and results.

Begin with `session`, which says what belongs to the inputs as they are now; `node` is what can be computed, `inputs`
what from. `project` is what is in a directory, `edited_file` a file with its edits; `origin` says it on the command
line.
"""
