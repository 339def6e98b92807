"""The view of textures in a browser."""
