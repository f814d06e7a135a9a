"""Reading plain photographs: where the edges of the groove run, by the step of light between land and wall."""
