"""The seed paper, section by section: what it claims, what comes out here, and why the two differ."""
