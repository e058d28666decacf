"""What the gap workflow has found, as an explanation, as text, and read again from its files."""
