"""Which scenario watches which parameter: each changed by what its user would notice, until a scenario falls out."""
