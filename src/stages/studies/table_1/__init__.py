"""Study `table_1`: plate forces on a cube of each of the paper's materials."""
