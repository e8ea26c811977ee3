"""The shell: sockets, clocks, threads, database and screens around the functional core in `pipeline`."""
