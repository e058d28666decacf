"""What scans show of each beam: residuals, detections, false echoes; and the summaries of these over covariates."""
