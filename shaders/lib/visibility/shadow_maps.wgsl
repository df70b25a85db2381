// lib/visibility/shadow_maps
