"""REST, documents and pages: the running service as HTTP."""
