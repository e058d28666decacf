"""The exact chain: from pulses in bins to echoes, compiled."""
