// hemisphere_tiles/ray_cast
