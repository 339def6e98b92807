"""The dashboard's server side: its page, and live data over a WebSocket; see `docs/live.md`."""
