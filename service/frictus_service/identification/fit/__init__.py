"""Laws fitted to the conditions of a study: friction, mobility, speed."""
