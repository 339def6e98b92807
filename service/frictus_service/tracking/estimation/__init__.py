"""The law of a finger from windows of what is played and felt, update by update."""
