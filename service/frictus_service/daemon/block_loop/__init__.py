"""What happens in each block: input, checks, rendering, output, and what is told of it."""
