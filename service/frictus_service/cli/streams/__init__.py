"""Commands on what a rig plays and publishes: shown, felt, recorded, followed, passed on."""
