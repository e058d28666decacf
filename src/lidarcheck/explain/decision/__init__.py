"""What is said of a case: whether the gap is closed, which names it needs, which others explain it as well."""
