"""Server: REST, events and the operator's page; assembles daq and processing, owns no physics."""
