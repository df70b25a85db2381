// lib/visibility/rays
