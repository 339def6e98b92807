"""Who may do what on the network: certificates, roles, and the router's access control."""
