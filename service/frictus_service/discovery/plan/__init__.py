"""What a design can show, before a finger slides: effects, their sizes, what looks alike."""
