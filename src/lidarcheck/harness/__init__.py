"""Golden-file harness: scenarios, goldens, the gate and its review.

`check` runs scenarios against their goldens; `scenario_run` holds one of them while it is checked, `layout` finds
a project's files, `frames` makes many frames, `pytest_plugin` collects scenarios as tests.
"""
