// normalize
