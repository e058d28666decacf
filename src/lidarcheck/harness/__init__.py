"""Golden-file harness: scenarios, goldens, the gate and its review."""
