"""The TMP117 thermometer for `hil`: a role, a driver, a peer, a plant and a fault."""
