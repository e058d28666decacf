"""What the screens compute, without a terminal. Begin with `job`, which screens of pages list and compute.

`scenes`, `vehicles`, `noise` and `ghosts` make such jobs of a project's files; `profiles` are Blooming's, `checks`
Overview's, `proposals` Goldens', `explain_cases` and `explain_process` Explain's.
"""
