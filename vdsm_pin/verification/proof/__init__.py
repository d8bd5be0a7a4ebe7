"""The compiled part of the clearance proof (docs/certificate.md)."""
