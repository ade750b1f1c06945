"""The only door to time: virtual time for benches, wall stamps for evidence."""
