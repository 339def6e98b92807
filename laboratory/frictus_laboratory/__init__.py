"""What makes tables and figures of frictus: benchmarks, and the paper simulated."""
