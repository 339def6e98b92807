"""Whether measurements can be what they claim, before anything is fitted to them."""
