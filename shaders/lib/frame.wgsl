// lib/frame
