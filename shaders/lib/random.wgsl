// lib/random
