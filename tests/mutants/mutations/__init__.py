"""Mutations by kind of file: each changes a case's folder with a seeded generator, and says what that did to places."""
