"""Recordings of other programs as studies: read, mapped to channels, cut into strokes."""
