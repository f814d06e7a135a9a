"""The platter: angle, radius and time; groove speed."""
