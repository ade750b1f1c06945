"""The package: a sealed bag, its reader, its verification."""
