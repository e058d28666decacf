"""The commands of calibration, a file each: bloom, calibrate, ghosts, lut, panels, scenes, vehicles."""
