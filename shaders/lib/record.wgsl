// lib/record
