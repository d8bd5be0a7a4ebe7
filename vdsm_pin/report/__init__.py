"""Records to CSV, JSON, HTML and JUnit; no physics."""
