"""Self-contained HTML pages, without scripts: a workflow's (`page`), a check's, a gap's (`explanation`), a release's.

Each stands alone, so that a command loads only its own; `environment` holds what their templates share.
"""
