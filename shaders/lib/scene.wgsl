// lib/scene
