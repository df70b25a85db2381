// find_misses/device_grid
