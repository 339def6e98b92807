"""What a client does over the WebSocket."""
