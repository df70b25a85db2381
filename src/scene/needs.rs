//! What a scene requires of a pipeline.
