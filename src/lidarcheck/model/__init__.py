"""The sensor model: from what a beam meets to its echoes."""
