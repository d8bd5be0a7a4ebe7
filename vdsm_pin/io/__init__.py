"""Files in and out; units end here."""
