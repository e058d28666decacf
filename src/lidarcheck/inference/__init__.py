"""What explaining and calibrating share: beams as a table, residuals, summaries, the fit, and the gap."""
