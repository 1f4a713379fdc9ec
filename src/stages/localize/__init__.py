"""Stage `localize`: where each side shows what the other marks."""
