"""The REST API: rigs, scenes, models, textures, health and metrics. See `docs/rest.md`."""
