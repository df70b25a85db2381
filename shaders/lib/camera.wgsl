// lib/camera
