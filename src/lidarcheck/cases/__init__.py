"""A case: measured frames, what their beams met, and the model that should explain them; read, checked and split."""
