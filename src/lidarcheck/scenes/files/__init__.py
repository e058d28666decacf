"""A scene's file: its objects and their shapes."""
