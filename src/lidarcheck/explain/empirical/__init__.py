"""Describing what no name explains: empirical terms fitted to what a model leaves over."""
