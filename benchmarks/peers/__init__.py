"""What users would use instead, behind one call each."""
