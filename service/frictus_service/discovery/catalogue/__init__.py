"""The catalogue of causes: what each is in words, and the page that lists them."""
