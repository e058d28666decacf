"""Cloud: measured and simulated points beside each other, or over each other, and maps of where they disagree."""
