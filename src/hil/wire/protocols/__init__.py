"""URL schemes for pyserial: `sim://<world>/<device>` and `replay://<world>/<device>`."""
