"""What a rig says of itself: noise, loop-back, step latency, orientation of its sensors."""
