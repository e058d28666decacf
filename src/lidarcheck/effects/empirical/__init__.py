"""Empirical terms: curves of at most two covariates, for what no effect of the catalogue explains."""
