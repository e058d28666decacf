"""What the screens compute, without a terminal: checks, explanations, pages of workflows, proposals."""
