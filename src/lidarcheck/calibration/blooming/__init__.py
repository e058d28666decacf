"""Fitting the blooming tables: what a target shows, what a table would make of it, and the table between the two.

`workflow` says what is done in which order; `lut_edit` and `settings_edit` change the files by hand.
"""
