// lib/trace
