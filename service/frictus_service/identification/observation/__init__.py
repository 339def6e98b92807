"""What one trial measured: a complex response per sweep, third of the stroke and tone."""
