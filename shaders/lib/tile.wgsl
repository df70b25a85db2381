// lib/tile
