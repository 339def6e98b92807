"""The decision: causes named, patterns left unexplained, and the gain of extending."""
