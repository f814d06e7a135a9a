"""Reading a wall by the relations between neighbouring rows of its texture."""
