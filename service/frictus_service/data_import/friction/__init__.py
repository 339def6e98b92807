"""What slides without a drive show: friction coefficient, texture and stick-slip."""
