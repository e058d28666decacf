"""The screen Goldens: what runs have proposed, what speaks against it, and accepting or dropping it."""
