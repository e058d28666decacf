"""A scene's file: its objects and their shapes.

`file` reads one, `shapes` says what each kind of object may have, `objects` builds them.
"""
