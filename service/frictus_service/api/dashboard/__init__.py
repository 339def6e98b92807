"""The server side of pages: the dashboard, and the WebSocket of `docs/websocket.md`."""
