"""Pictures and exports of one case, made from its artefacts; one module per kind."""
