// hemisphere_tiles/shade
