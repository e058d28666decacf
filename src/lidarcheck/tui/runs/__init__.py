"""Commands that are started from the interface: asked for, run beside it, and what they find taken over."""
