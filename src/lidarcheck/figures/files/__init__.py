"""What a command leaves on the disk, checked before the work and written all or none.

`outputs`: single files; `result_folder`: page, numbers and pictures of a workflow; `pictures`: a figure as PNG or SVG.
"""
