// hemisphere_tiles/raster
