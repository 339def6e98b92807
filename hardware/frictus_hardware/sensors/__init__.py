"""The sensors of a real rig: calibrations, frames and protocols, without any device."""
