"""The gap workflow: where model and measurement disagree, and why; `workflow` reads like its description."""
