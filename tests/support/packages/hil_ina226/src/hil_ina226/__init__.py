"""The INA226 power monitor for `hil`: a role, a driver, a peer, a plant and a fault."""
