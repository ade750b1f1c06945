"""Roles that cases ask for, and the drivers that fill them."""
