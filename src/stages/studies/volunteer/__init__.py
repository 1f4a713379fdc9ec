"""Study `paper_tables`: a volunteer's landmarks, Tables II to IV."""
