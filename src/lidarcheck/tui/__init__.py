"""The terminal interface. Begin with `app`, which composes it, and `actions`, the table of all that can be done.

`screens` stand in the app and know it as a `host`; `jobs` are what they compute, without a terminal; `widgets` are
panes of lines and questions. What is open and edited is kept by `lidarcheck.session`.
"""
