"""A lidar that times pulses by a comparator: a sensor model that is not lidarcheck's, of numpy alone."""
