"""What the screens have in common that show the pages of a workflow: Histograms, Noise, Ghosts, the maps of Cloud."""
