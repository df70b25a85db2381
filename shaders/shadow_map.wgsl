// shadow_map
