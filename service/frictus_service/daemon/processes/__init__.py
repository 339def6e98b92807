"""The processes of a service, and who starts, watches and ends them."""
