"""How stage `tables` writes: what each table holds, its statistics, and its forms as CSV, text, HTML and netCDF."""
