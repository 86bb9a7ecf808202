"""Stand-ins for other packages' readers."""
