"""What a person has open: the project, the files being edited, undo, and a journal that outlives the process.

Begin with `project`, what is in a directory, and `edited_file`, a file with its edits; `pairing` and `model_choice`
say which files belong together.
"""
