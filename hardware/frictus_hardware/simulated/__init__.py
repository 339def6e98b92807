"""The simulated rig: virtual fingers, sensors, faults and clocks around the twin."""
