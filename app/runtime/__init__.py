"""The threads of the running service: one a radar, one for the surface, bounded queues between them."""
