"""What results look like: figures computed once as data, and the backends that draw them.

`data` is what a figure, a table and a page hold; `pages` and `gap` fill them from results; `axes` lays a figure out;
`terminal`, `svg`, `png` and `html` draw, and compute nothing else; `files` writes what a command leaves in a directory.
"""
