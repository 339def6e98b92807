"""All trials of a study through worker processes, with a cache by content."""
