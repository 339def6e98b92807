"""What `frictus bench` measures: one figure or family of figures in each file."""
