"""The photon histogram: counts of many shots in bins, and the echoes that a chip finds in them."""
