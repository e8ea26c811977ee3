"""Reference data: the types of aircraft and vehicles, with their dimensions."""
