"""What a person has open: the project, the files being edited, undo, and a journal that outlives the process."""
