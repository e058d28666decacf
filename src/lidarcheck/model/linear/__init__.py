"""The linear detector: one amplitude a shot and surface, held against a threshold."""
