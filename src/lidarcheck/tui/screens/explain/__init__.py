"""The screen Explain: the cases of a project, a run in a process of its own, and the answer part by part."""
