"""Newport ESP301 motion controllers with a rotation stage."""
