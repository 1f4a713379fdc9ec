"""What runs a stage and keeps what it leaves: contract, artefacts, configuration, digests."""
