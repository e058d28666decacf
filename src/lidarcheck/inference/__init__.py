"""What explaining and calibrating share: observations of beams, summaries, metric, descent, intervals and the gap."""
