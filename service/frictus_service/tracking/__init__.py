"""The finger-screen model of whoever explores, estimated while any texture plays."""
