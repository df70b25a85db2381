// direct_light
