"""What a volume says: figures, and the measurements of later stages."""
