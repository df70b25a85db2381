// lib/light
