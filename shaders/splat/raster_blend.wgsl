// splat/raster_blend
