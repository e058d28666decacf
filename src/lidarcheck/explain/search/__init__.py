"""The search for what is missing: where it begins, what each candidate would change, what is accepted."""
