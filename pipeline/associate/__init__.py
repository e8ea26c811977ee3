"""Which measurement belongs to which track."""
