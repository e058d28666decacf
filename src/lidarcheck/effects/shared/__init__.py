"""What several effects have in common: draws, ranges, the air, the scattering of bright light."""
