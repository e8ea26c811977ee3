"""What `airside bench` measures of the running service, in processes of its own."""
