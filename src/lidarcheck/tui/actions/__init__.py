"""Every action of the interface: name, keys, help, method and its twin on the command line."""
