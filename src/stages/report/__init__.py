"""Stage `report`: the page that opens in any browser."""
