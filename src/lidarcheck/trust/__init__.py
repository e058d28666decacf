"""Trust: which programs may run that a model names, and which files a project's files may name."""
