"""The device daemon: safety, the block loop, its threads, and the supervisor over them."""
